"""Invalid arguments: each is refused in one line that states the remedy."""

from pathlib import Path

import pytest

from .conftest import Emaphm, Refusal

KNOWN_FAULTS = "backlash, eccentricity, eccentricity_phase, friction, gain, short_a, short_b, short_c"

BAD_ARGUMENTS = {
    # no such verb, option or value
    "simul out.csv": ('"simul"', 'Did you mean "simulate"?'),
    "--bogus": ('"--bogus"', "Available commands: demo, init, simulate, diagnose, calibrate, replay"),
    "simulate out.csv --nois 1": ("--nois", "Did you mean --noise?"),
    "simulate out.csv other.csv": ("other.csv",),
    "replay good.csv --json=maybe": ("--json", '"maybe"'),
    "replay good.csv --model averaged --model monitor": ("--model", "multiple times"),
    "demo extra": ("extra",),
    # missing arguments
    "simulate": ("'emaphm simulate' requires OUT", "See emaphm simulate --help"),
    "diagnose": ("'emaphm diagnose' requires RECORDING", "See emaphm diagnose --help"),
    "replay": ("'emaphm replay' requires RECORDING", "See emaphm replay --help"),
    "calibrate good.csv -o out.toml": ("--free and --laws are left out", "name parameters with --free"),
    "calibrate good.csv --free inertia": ("'emaphm calibrate' requires --out", "See emaphm calibrate --help"),
    "simulate out.csv --fault": ("--fault requires a value", "See emaphm simulate --help"),
    # faults
    "simulate out.csv --fault friction": ("--fault friction", "NAME=VALUE, e.g. friction=0.25"),
    "simulate out.csv --fault friction=": ("--fault friction=", "NAME=VALUE"),
    "simulate out.csv --fault friction=abc": ("friction=abc", "NAME=VALUE"),
    "simulate out.csv --fault friction=0,3": ("friction=0,3", "NAME=VALUE"),
    "simulate out.csv --fault friction:0.3": ("friction:0.3", "NAME=VALUE"),
    "simulate out.csv --fault friction=0.3=4": ("friction=0.3=4", "NAME=VALUE"),
    "simulate out.csv --fault =0.3": ("unknown fault ''", KNOWN_FAULTS),
    "simulate out.csv --fault frictoin=0.3": ("'frictoin'", "did you mean 'friction'?"),
    "simulate out.csv --fault FRICTION=0.3": ("'FRICTION'", "did you mean 'friction'?"),
    "simulate out.csv --fault wear=0.3": ("'wear'", KNOWN_FAULTS),
    "simulate out.csv --fault friction=1.5": ("friction=1.5", "outside [-1, 1]"),
    "simulate out.csv --fault friction=-0.6": ("fault friction=-0.6 lies outside [-0.45, 1]",),
    "simulate out.csv --fault backlash=-0.1": ("backlash=-0.1", "outside [0, 1]"),
    "simulate out.csv --fault gain=nan": ("gain=nan", "outside [0, 1]"),
    "simulate out.csv --fault gain=inf": ("gain=inf", "outside [0, 1]"),
    "simulate out.csv --fault gain=0.5 --fault backlash=2": ("backlash=2", "outside [0, 1]"),
    "replay good.csv --fault friction=2": ("friction=2", "outside [-1, 1]"),
    # seeds
    "demo --seed -1": ("--seed -1", "give 0 or more"),
    "simulate out.csv --seed -1": ("--seed -1", "give 0 or more"),
    "diagnose good.csv --seed -1": ("--seed -1", "give 0 or more"),
    "calibrate good.csv --free inertia -o out.toml --seed -1": ("--seed -1", "give 0 or more"),
    "replay good.csv --seed -1": ("--seed -1", "give 0 or more"),
    "simulate out.csv --about 0.6": ("would rest at 0.6 first", "end stops [-0.5236, 0.5236]", "--about"),
    "design --about 0.6": ("would rest at 0.6 first", "end stops [-0.5236, 0.5236]", "--about"),
    "simulate out.csv --amplitude 0 --about 0.1 --model averaged": (
        "nothing was commanded",
        "0.1 throughout",
    ),
    "simulate out.csv --about nan": ("not finite", "--about nan"),
    "simulate out.csv --seed abc": ("--seed", '"abc"', "int"),
    "simulate out.csv --seed nan": ("--seed", '"nan"', "int"),
    # A seed is not rounded, because another seed gives other numbers.
    "simulate out.csv --seed 1.5": ("--seed", '"1.5"', "whole number"),
    "simulate out.csv --adc-bits 12.5": ("--adc-bits", '"12.5"', "whole number"),
    "design --tests 1.5": ("--tests", '"1.5"', "whole number"),
    "replay a\0b.csv": ("null character", "leave it out"),
    "simulate a\0b.csv": ("null character", "leave it out"),
    # the manoeuvre
    "simulate out.csv --duration 0": ("duration", "0"),
    "simulate out.csv --duration -1": ("duration", "-1"),
    "simulate out.csv --duration nan": ("duration", "nan"),
    "simulate out.csv --duration inf": ("duration", "inf"),
    "simulate out.csv --duration 0.5s": ("--duration", '"0.5s"', "float"),
    "simulate out.csv --duration 0 --command ramp": ("duration", "0"),
    "simulate out.csv --duration 1e-9": ("samples (0)", "above 0"),
    "simulate out.csv --duration 0.009 --model averaged": ("45 rows", "at least 50"),
    "simulate out.csv --duration 1e9": ("1e+09 s are too long", "300 s are possible"),
    "simulate out.csv --duration 1e9 --model averaged": ("1e+09 s are too long", "15000 s are possible"),
    "simulate out.csv --sample-rate 0": ("sample rate (0 Hz)", "above 0"),
    "simulate out.csv --sample-rate -5": ("sample rate (-5 Hz)", "above 0"),
    "simulate out.csv --sample-rate nan": ("sample rate (nan Hz)", "above 0"),
    "simulate out.csv --sample-rate inf": ("sample rate (inf Hz)", "above 0"),
    # More rows than fit in memory; the last number is beyond the range of a float.
    "simulate out.csv --sample-rate 1e9": ("5e+08 rows are too many", "are possible"),
    "simulate out.csv --sample-rate 1e300": ("rows are too many", "sample slower"),
    "simulate out.csv --sample-rate 1e308 --duration 299": ("rows are too many", "sample slower"),
    "simulate out.csv --amplitude nan": ("command is not finite",),
    "simulate out.csv --amplitude 0 --model averaged": ("nothing was commanded", "0 throughout"),
    "simulate out.csv --command sine --frequency 0 --model averaged": ("nothing was commanded",),
    "simulate out.csv --frequency nan": ("command is not finite", "--frequency nan;"),
    "simulate out.csv --frequency -3": ("--frequency -3", "give 0 Hz or more"),
    "history add good.csv --unit A --hours 1 --estimator absent": ("absent: no such file",),
    "study report good.csv": ("good.csv holds no study",),
    "serve --seed -1": ("--seed -1", "give 0 or more"),
    "simulate out.csv --frequency 4000": ("above half of the 5000 rows a second", "--sample-rate"),
    "train -o out.estimator --frequency 60 --sample-rate 100": ("above half of the 100 rows",),
    "design --frequency 2501 --tests 0": ("above half of the 5000 rows",),
    "simulate out.csv --command step --frequency 4": ("--frequency is of chirp", "leave it out with 'step'"),
    "simulate out.csv --command good.csv --amplitude 3": ("--amplitude is of", "with a file"),
    "diagnose good.csv --nuisance load,none": ("'none' alone",),
    "diagnose good.csv --workers 0": ("--workers 0", "1 or more"),
    "diagnose good.csv --known temperature=300": ("temperature", "did you mean 'temperature_K'?"),
    "diagnose good.csv --known Load_nm=0.1": ("Load_nm", "did you mean 'load_Nm'?"),
    "simulate out.csv --command chrip": ("'chrip'", "chirp, decaying-chirp, step, ramp, sine", "file"),
    "simulate out.csv --command absent.csv": ("absent.csv", "no such file"),
    "simulate out.csv --load nan": ("load is not finite",),
    "simulate out.csv --load inf": ("load is not finite",),
    "simulate out.csv --load absent.csv": ("absent.csv", "no such file"),
    # sensors
    "simulate out.csv --model averaged --noise -1": ("noise", "-1", "give 0 or more"),
    "simulate out.csv --model averaged --noise nan": ("noise", "nan", "give 0 or more"),
    "simulate out.csv --model averaged --noise inf": ("noise", "inf", "give 0 or more"),
    "simulate out.csv --model averaged --noise 1e300": ("--noise 1e+300 A", "current limit of 22.5 A"),
    "simulate out.csv --model averaged --adc-bits 1": ("1 bits", "give 4 to 24"),
    "simulate out.csv --model averaged --adc-bits -3": ("-3 bits", "give 4 to 24"),
    "simulate out.csv --model averaged --adc-bits 64": ("64 bits", "give 4 to 24"),
    "simulate out.csv --adc-bits twelve": ("--adc-bits", '"twelve"', "int"),
    # names of models, methods and parameters
    "simulate out.csv --model refernce": ("'refernce'", "did you mean 'reference'?"),
    "replay good.csv --model avraged": ("'avraged'", "did you mean 'averaged'?"),
    "replay good.csv --model x": ("'x'", "known: averaged, monitor, reference"),
    "diagnose good.csv --model avraged": ("'avraged'", "did you mean 'averaged'?"),
    "diagnose good.csv --method hybird": ("'hybird'", "did you mean 'hybrid'?"),
    "diagnose good.csv --method dragonfly --fitness least": ("'least'", "did you mean 'least_squares'?"),
    "diagnose good.csv --method de --nuisance load": ("faults alone", "'differential-evolution+lsq'"),
    "diagnose good.csv --nuisance lod": ("'lod'", "did you mean 'load'?"),
    "diagnose good.csv --fitness thesis": ("'hybrid'", "least_squares", "optimiser alone"),
    "calibrate good.csv -o out.toml --free inertai": ("'inertai'", "did you mean 'inertia'?"),
    "calibrate good.csv -o out.toml --free inertia,inertai": ("'inertai'", "did you mean 'inertia'?"),
    "calibrate good.csv -o out.toml --free inertia;viscous": ("'inertia;viscous'",),
    "calibrate good.csv -o out.toml --free ,": ("no parameter to calibrate", "inertia, viscous, coulomb"),
    "calibrate good.csv -o out.toml --free=": ("no parameter to calibrate", "inertia, viscous, coulomb"),
    "calibrate good.csv -o out.toml --free speed_lag": ("'speed_lag' is 0", "give an estimate"),
    "calibrate -o out.toml --free inertia": ("no recording to calibrate from", "or several"),
    "calibrate good.csv absent.csv -o out.toml --free inertia": ("absent.csv", "no such file"),
    "calibrate good.csv good.csv -o out.toml --free inertia": ("good.csv: this file is given twice, and",),
    "calibrate good.csv -o out.toml --free offset --nuisance load": ("'load'", "'offset'", "leave one out"),
    "calibrate good.csv -o out.toml --laws auto": ("two recordings at least", "or name the laws"),
    "calibrate good.csv -o out.toml --laws stribek": ("unknown law 'stribek'", "did you mean 'stribeck'?"),
    "calibrate good.csv -o out.toml --laws auto,gravity": ("'auto'", "give it alone"),
    "calibrate good.csv -o out.toml --laws none": ("no law to add", "stribeck"),
    "calibrate good.csv -o out.toml --free inertia --loop mesured": ("--loop", '"mesured"', "measured"),
    "calibrate good.csv -o out.toml --free backlash --loop measured": ("'backlash'", "in closed loop"),
    "calibrate good.csv -o out.toml --free position_gian": ("did you mean 'position_gain'?",),
}

FURTHER = {
    "simulate out.csv --model averaged --fault gain=0.4 --fault gain=0.6": ("gain", "twice"),
    # Not finite; NumPy's warning must not appear.
    "simulate out.csv --amplitude inf": ("amplitude", "inf"),
    "simulate out.csv --frequency inf": ("frequency", "inf"),
    # Neither a number nor a file.
    "simulate out.csv --load 0,05": ("--load", "0,05", "number"),
    # The message names the option, not a channel.
    "simulate out.csv --model averaged --noise -2": ("--noise -2",),
}


@pytest.mark.parametrize("line", BAD_ARGUMENTS)
def test_bad_arguments_are_refused_in_one_line(refused: Refusal, line: str) -> None:
    message = refused(*line.split())
    for piece in BAD_ARGUMENTS[line]:
        assert piece in message


@pytest.mark.parametrize("line", FURTHER)
def test_further_bad_arguments_are_refused_in_one_line(refused: Refusal, line: str) -> None:
    message = refused(*line.split())
    for piece in FURTHER[line]:
        assert piece in message


@pytest.mark.parametrize(
    "line",
    [
        "simulate out.csv --json --fault friction=2",
        "diagnose absent.csv --json",
        "diagnose good.csv --json --method hybird",
        "calibrate good.csv --json --free inertai -o out.toml",
        "replay good.csv --json --model x",
        "demo --json --seed -1",
        "replay good.csv --json --nois",
    ],
)
def test_a_refusal_with_json_leaves_stdout_empty(refused: Refusal, line: str) -> None:
    # `refused` checks that stdout is empty: a program that reads it must not find half an object.
    assert "{" not in refused(*line.split())


@pytest.mark.parametrize("option", ["--actuator", "--report", "--method", "--model", "--fault"])
def test_an_empty_value_is_refused(refused: Refusal, option: str) -> None:
    verb = "replay" if option == "--fault" else "diagnose"
    assert refused(verb, "good.csv", option, "")


@pytest.mark.parametrize(
    "line", ["replay ./-good.csv", "replay -- -good.csv", "replay --recording=-good.csv"]
)
def test_a_file_name_may_begin_with_a_dash(emaphm: Emaphm, desk: Path, line: str) -> None:
    (desk / "good.csv").rename(desk / "-good.csv")
    assert emaphm(*line.split()).code == 0


def test_a_missing_double_dash_is_explained(refused: Refusal) -> None:
    assert "-good.csv" in refused("replay", "-good.csv")

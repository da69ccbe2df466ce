"""Error messages for command lines that cannot be parsed."""

from cyclopts import CycloptsError, MissingArgumentError, UnusedCliTokensError


def wrong_use(error: CycloptsError) -> str:
    """Return the error message for a command line, with the command that prints its help."""
    verb = " ".join(("emaphm", *(error.command_chain or ())))
    return f"{_description(error, verb)} See {verb} --help."


def _description(error: CycloptsError, verb: str) -> str:
    """Return the error in one sentence."""
    if isinstance(error, MissingArgumentError) and error.argument is not None and not error.tokens_so_far:
        if error.keyword is not None:
            return f"{error.keyword} requires a value."
        is_positional = error.argument.index is not None
        name = error.argument.field_info.name.upper() if is_positional else error.argument.name
        return f"'{verb}' requires {name}."
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        return f"'{error.unused_tokens[0]}' is one argument more than '{verb}' takes."
    return " ".join(str(error).split())

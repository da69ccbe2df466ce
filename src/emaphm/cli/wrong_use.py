"""What is said of a command line that no verb understands."""

from cyclopts import CycloptsError, MissingArgumentError, UnusedCliTokensError


def wrong_use(error: CycloptsError) -> str:
    """Return what is wrong with a command line, and where its help is."""
    verb = " ".join(("emaphm", *(error.command_chain or ())))
    return f"{_said(error, verb)} See {verb} --help."


def _said(error: CycloptsError, verb: str) -> str:
    if isinstance(error, MissingArgumentError) and error.argument is not None and not error.tokens_so_far:
        if error.keyword is not None:
            return f"{error.keyword} requires a value."
        of_place = error.argument.index is not None
        name = error.argument.field_info.name.upper() if of_place else error.argument.name
        return f"'{verb}' requires {name}."
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        return f"'{error.unused_tokens[0]}' is one argument more than '{verb}' takes."
    return " ".join(str(error).split())

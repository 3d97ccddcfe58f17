"""Text of others in a user's terminal: no more than letters.

Logs, names and messages of a cluster, and what lies in a lake, come from others. A terminal obeys
control sequences that stand in what it shows: they change its title, fill the clipboard, hide or
forge lines.
"""

import re

from rich.text import Text

COLOUR = re.compile(r"\x1b\[[0-9;]*m")

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""What begins such a sequence or has an effect alone, and what turns the direction of letters."""


def printable(text: str) -> str:
    """Text without colours, and with its other control characters written out.

    Tabs and ends of lines stay.
    """
    if text.isprintable():
        return text
    bare = COLOUR.sub("", text)
    return CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), bare)


def printable_text(value: object) -> Text:
    """The same for a table's cell, in which brackets are brackets."""
    return Text(printable(str(value)))

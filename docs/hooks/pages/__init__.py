"""Pages of the documentation that are made from the code; each module here makes those of one subject, by ``pages()``."""

from __future__ import annotations

from pages import commands, findings, gallery, messages, pictures, schemas, tutorial

# Each has SECTION, the title of its section in the navigation, and pages().
GENERATORS = (tutorial, findings, pictures, commands, schemas, messages, gallery)

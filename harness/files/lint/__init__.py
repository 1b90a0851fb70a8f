"""What a mechanism's model may hold: the tables ``formats`` and ``refusals``, by which ``checks`` goes, and ``mechanisms`` beyond them."""

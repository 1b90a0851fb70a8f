"""What a mechanism's model may hold: the tables ``formats``, by which ``checks`` goes, and ``mechanisms`` beyond them."""

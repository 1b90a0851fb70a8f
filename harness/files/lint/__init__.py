"""Contents that a mechanism's model may have: the tables ``formats``, by which ``checks`` goes, and ``mechanisms`` beyond them."""

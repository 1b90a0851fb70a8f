"""The commands of ``harness``: every module here without a leading underscore holds one, called ``command``."""

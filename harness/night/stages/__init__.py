"""The stages of a night: every module here declares one, called ``STAGE``."""

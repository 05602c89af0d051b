"""Which version this is; all that says so takes it from here."""

__version__ = "0.1.0"

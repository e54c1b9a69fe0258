"""Configuration: one tree of every package's parameters, read, checked, dumped; and all files of a flight together."""

from companion.config.flight import Flight, load_flight, load_vehicle
from companion.config.load import config_schema, dump, fingerprint, load_config
from companion.config.tree import Config

__all__ = ["Config", "Flight", "config_schema", "dump", "fingerprint", "load_config", "load_flight", "load_vehicle"]

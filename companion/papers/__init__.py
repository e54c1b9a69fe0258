"""Experiments of published papers, flown again and held against the published figures."""

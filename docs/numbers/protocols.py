"""The measurements of docs/protocols.md and docs/report.md: published protocols, and the study."""

from measurement import Measurement

MEASUREMENTS: dict[str, Measurement] = {}

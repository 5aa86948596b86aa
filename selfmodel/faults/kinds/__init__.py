"""The fault kinds, one file per kind or group of kinds."""

"""The recorder: encoders, messages, bags and mappings."""

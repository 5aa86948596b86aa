"""The file of a trial log as verified MCAP: records, checksums, provenance of its batches."""

"""Study of the baselines: methods x robots x cases x gaps x seeds, on a resumable grid."""

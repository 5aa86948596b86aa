"""The golden set: results of two versions of selfmodel, compared to the last bit."""

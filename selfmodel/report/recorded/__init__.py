"""What a diagnosis was made with, as files of earlier commands name it."""

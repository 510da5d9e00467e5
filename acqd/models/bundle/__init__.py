"""Trained models on disk: file format, restoring, reference recordings, envelope."""

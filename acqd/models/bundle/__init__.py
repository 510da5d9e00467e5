"""Trained models on disk: format, restoring, remembered recordings, envelope."""

"""Judges `acqd save` on foreign plants: programs, their execution, and what was predicted and measured."""

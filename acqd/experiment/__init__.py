"""The motion that decides between causes: what the next recording has to show, and a program that shows it."""

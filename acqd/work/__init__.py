"""Energy of the work: cycles found in repeating motion, program, step, part and state, and what each of them takes."""

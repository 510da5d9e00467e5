"""The live page: rows as they come, past values from SQL, health; beside the chain that measures."""

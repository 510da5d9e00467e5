"""The live page: rows as they come, past values from SQL, health; apart from the chain that measures."""

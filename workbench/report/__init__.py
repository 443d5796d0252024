"""Results for people and programs: JSON, tables in the terminal, pictures."""

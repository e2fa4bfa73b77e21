"""What was measured on the shaker of the source, beside what recordings give: numbers, readings, table."""

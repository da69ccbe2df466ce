"""What other units of a part number teach about a new one."""

"""The framework of all experiments: studies and their store, commands, numbers, pictures, reports."""

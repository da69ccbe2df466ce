"""Spoilt inputs by the thousand: whatever is given, the command refuses it in one line or does its work."""

"""Migrations of the schema, run by alembic when a history is opened."""

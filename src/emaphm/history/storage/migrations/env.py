"""Script of alembic: applies the migrations in the caller's connection and transaction."""

from alembic import context

VERSION_TABLE = "history_version"

context.configure(
    connection=context.config.attributes["connection"],
    version_table=VERSION_TABLE,
    transactional_ddl=True,  # also on SQLite: the caller has started the transaction
)
with context.begin_transaction():
    context.run_migrations()

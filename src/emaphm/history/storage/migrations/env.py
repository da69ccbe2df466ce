"""Run by alembic: applies the steps on the connection, and in the transaction, that the caller holds."""

from alembic import context

VERSION_TABLE = "history_version"

context.configure(
    connection=context.config.attributes["connection"],
    version_table=VERSION_TABLE,
    transactional_ddl=True,  # on SQLite too: the caller has begun the transaction itself
)
with context.begin_transaction():
    context.run_migrations()

"""The database: tables, queries, migrations, backups, retention."""

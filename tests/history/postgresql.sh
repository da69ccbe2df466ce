#!/usr/bin/env bash
# A PostgreSQL server for the tests, on loopback, as an unprivileged user, with a password.
#   url=$(tests/history/postgresql.sh start FOLDER)   starts it with its data in the new folder FOLDER
#   tests/history/postgresql.sh stop FOLDER           stops it and removes FOLDER
# Installs Debian's package where it is missing, as root; fails where it cannot, with the reason on stderr.
set -euo pipefail

folder=${2:?give a folder}

programs() { compgen -G '/usr/lib/postgresql/*/bin' | sort -V | tail -n 1; }

# The server refuses to run as root.
as_server() { if [ "$(id -u)" = 0 ]; then runuser -u postgres -- "$@"; else "$@"; fi; }

install_server() {
    [ "$(id -u)" = 0 ] && command -v apt-get > /dev/null || { echo "PostgreSQL is missing" >&2; return 1; }
    export DEBIAN_FRONTEND=noninteractive
    timeout 120 apt-get update -qq && timeout 300 apt-get install -y -qq --no-install-recommends postgresql
}

start() {
    [ -n "$(programs)" ] || install_server >&2 || { echo "PostgreSQL cannot be installed" >&2; exit 1; }
    local bin port password
    bin=$(programs)
    port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
    password=$(python3 -c 'import secrets; print(secrets.token_hex(16))')
    mkdir "$folder"
    chmod 711 "$folder"
    echo "$password" > "$folder/password"
    [ "$(id -u)" != 0 ] || chown -R postgres "$folder"
    cd "$folder"  # one that the server's user may enter
    as_server "$bin/initdb" --pgdata="$folder/data" --username=emaphm --pwfile="$folder/password" \
        --auth=scram-sha-256 --encoding=UTF8 --locale=C.UTF-8 > /dev/null
    as_server "$bin/pg_ctl" --pgdata="$folder/data" --log="$folder/log" --wait --timeout=60 start > /dev/null \
        --options="-c listen_addresses=127.0.0.1 -c port=$port -c unix_socket_directories= -c fsync=off" \
        || { cat "$folder/log" >&2; exit 1; }
    echo "postgresql://emaphm:$password@127.0.0.1:$port/postgres"
}

stop() {
    local bin
    bin=$(programs)
    cd /
    as_server "$bin/pg_ctl" --pgdata="$folder/data" --mode=immediate stop > /dev/null || true
    rm -rf "$folder"
}

"${1:?start or stop}"

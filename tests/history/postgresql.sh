#!/usr/bin/env bash
# A PostgreSQL server for the tests, on loopback, as an unprivileged user, with a password.
#   url=$(tests/history/postgresql.sh start FOLDER)   starts it with its data in the new folder FOLDER
#   tests/history/postgresql.sh stop FOLDER           stops it and removes FOLDER
# Debian's package is installed where it is missing, as root; else it fails, with the reason on stderr.
set -euo pipefail

action=${1:?start or stop}
folder=${2:?a folder}

programs() { compgen -G '/usr/lib/postgresql/*/bin/initdb' | sort -V | tail -n 1 | xargs -r dirname; }

# The server refuses to run as root.
as_server() { if [ "$(id -u)" = 0 ]; then runuser -u postgres -- "$@"; else "$@"; fi; }

fail() { echo "PostgreSQL: $1" >&2; exit 1; }

install_server() {
    [ "$(id -u)" = 0 ] || fail "is missing, and only root may install it"
    command -v apt-get > /dev/null || fail "is missing, and there is no apt-get to install it"
    export DEBIAN_FRONTEND=noninteractive
    timeout 120 apt-get update -qq >&2 || fail "is missing, and no package mirror answers"
    timeout 300 apt-get install -y -qq --no-install-recommends postgresql >&2 || fail "cannot be installed"
}

start() {
    local bin port password options
    bin=$(programs) || true
    if [ -z "$bin" ]; then
        install_server
        bin=$(programs) || fail "was installed, but its programs are not found"
    fi
    port=$(python3 -c 'import socket; s = socket.create_server(("127.0.0.1", 0)); print(s.getsockname()[1])')
    password=$(python3 -c 'import secrets; print(secrets.token_hex(16))')
    options="-c listen_addresses=127.0.0.1 -c port=$port -c unix_socket_directories= -c fsync=off"
    mkdir -m 711 "$folder"
    (umask 077 && echo "$password" > "$folder/password")
    [ "$(id -u)" != 0 ] || chown -R postgres "$folder"
    cd "$folder"  # the server's user may be unable to enter another
    as_server "$bin/initdb" --pgdata="$folder/data" --username=emaphm --pwfile="$folder/password" \
        --auth=scram-sha-256 --encoding=UTF8 --locale=C.UTF-8 --no-sync > /dev/null || fail "initdb failed"
    as_server "$bin/pg_ctl" start --pgdata="$folder/data" --log="$folder/log" --wait --timeout=60 \
        --options="$options" > /dev/null || { cat "$folder/log" >&2; fail "does not start"; }
    echo "postgresql://emaphm:$password@127.0.0.1:$port/postgres"
}

stop() {
    [ -d "$folder" ] || return 0
    cd "$folder"
    as_server "$(programs)/pg_ctl" stop --pgdata="$folder/data" --mode=immediate > /dev/null || true
    cd /
    rm -rf "$folder"
}

case $action in
    start) start ;;
    stop) stop ;;
    *) fail "start or stop, not '$action'" ;;
esac

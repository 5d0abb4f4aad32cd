#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs PostgreSQL with a database for rigcal-server, which is made at the first start. For the image `database` of
# deploy/Containerfile; the user and the database are called rigcal, the password is RIGCAL_DATABASE_PASSWORD.
#   database.sh [FOLDER [OPTION...]]   options are those of `postgres`
set -eu
data=${1:-/var/lib/postgresql/rigcal}
[ $# -eq 0 ] || shift
bin=$(ls -d /usr/lib/postgresql/*/bin | sort -V | tail -n 1)
if [ ! -s "$data/PG_VERSION" ]; then
  : "${RIGCAL_DATABASE_PASSWORD:?set RIGCAL_DATABASE_PASSWORD: the password of user rigcal}"
  # A folder that is left half made would look complete at the next start.
  rm -rf "$data.new"
  umask 077
  password=$(mktemp)
  printf '%s\n' "$RIGCAL_DATABASE_PASSWORD" > "$password"
  "$bin/initdb" --pgdata "$data.new" --username rigcal --pwfile "$password" --encoding UTF8 --locale C.UTF-8 \
    --auth-local trust --auth-host scram-sha-256 > /dev/null
  rm "$password"
  echo "host all rigcal all scram-sha-256" >> "$data.new/pg_hba.conf"
  echo "CREATE DATABASE rigcal;" | "$bin/postgres" --single -D "$data.new" postgres > /dev/null
  mv "$data.new" "$data"
fi
exec "$bin/postgres" -D "$data" -c listen_addresses='*' "$@"

#!/usr/bin/env bash
# Checks the service on PostgreSQL behind PgBouncer: in session mode it works and its sessions keep their limits, every
# other mode and every refusal by PgBouncer ends the start with the cause.
#
#   scripts/check/pgbouncer.sh
#
# scripts/check/pgbouncer.py starts both servers and the service on loopback; as root it starts the servers as the user
# `postgres`. Takes half a minute. Exits with 1 if anything is wrong. Debian's postgresql and pgbouncer are installed if
# they are missing.
set -euo pipefail
cd "$(dirname "$0")/../.."

# shellcheck source=scripts/lib/dicom_tools.sh
. scripts/lib/dicom_tools.sh
ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || debian postgresql
[ -x /usr/sbin/pgbouncer ] || debian pgbouncer
program=${PROGRAM:-target/debug/ventriform}
[ -x "$program" ] || cargo build --quiet --bins --test layering

"${PYTHON:-python3}" scripts/check/pgbouncer.py --program "$program"

#!/usr/bin/env bash
# Runs a command with one service of S3 for all its tests: stories.sh WEED COMMAND… It is started here, and ends with the command.
# Tests that kill it or have it refuse start one of their own.
set -euo pipefail
weed=$1
shift
folder=$(mktemp -d)
server=
trap '[ -z "$server" ] || { kill "$server" && wait "$server" || true; }; rm -rf "$folder"' EXIT
# Eight ports in a row for its four parts and their own calls, below those that the system gives to connections.
port=$((12000 + $$ % 1000 * 8))
echo '{"identities":[{"name":"tests","credentials":[{"accessKey":"tests","secretKey":"secret-of-the-tests"}],"actions":["Admin","Read","Write","List"]}]}' >"$folder/users.json"
mkdir "$folder/data"
"$weed" server -ip=127.0.0.1 -ip.bind=127.0.0.1 -dir="$folder/data" -filer -filer.localSocket="$folder/filer" \
    -s3 -s3.localSocket="$folder/s3" -s3.config="$folder/users.json" -s3.port.iceberg=0 -s3.port.lance=0 -metricsPort=0 \
    -master.telemetry=false -master.volumeSizeLimitMB=64 -volume.max=64 \
    -master.port="$port" -master.port.grpc=$((port + 1)) -volume.port=$((port + 2)) -volume.port.grpc=$((port + 3)) \
    -filer.port=$((port + 4)) -filer.port.grpc=$((port + 5)) -s3.port=$((port + 6)) -s3.port.grpc=$((port + 7)) >"$folder/log" 2>&1 &
server=$!
for _ in $(seq 60); do
    # It accepts connections before it can store; what the bucket is asked for says so.
    echo "s3.bucket.create -name cager" | timeout 5 "$weed" shell -master="127.0.0.1:$port.$((port + 1))" \
        -filer="127.0.0.1:$((port + 4)).$((port + 5))" >/dev/null 2>&1 || true
    if echo "s3.bucket.list" | timeout 5 "$weed" shell -master="127.0.0.1:$port.$((port + 1))" \
        -filer="127.0.0.1:$((port + 4)).$((port + 5))" 2>/dev/null | grep -q cager; then
        CAGER_SEAWEEDFS=$weed CAGER_TEST_S3=http://127.0.0.1:$((port + 6)) CAGER_TEST_CATALOG=postgres+s3 "$@"
        exit
    fi
    sleep 1
done
cat "$folder/log" >&2
echo "the service of S3 does not answer" >&2
exit 1

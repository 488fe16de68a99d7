#!/usr/bin/env bash
# The farm of docker-compose.yml against `lightfarm render`: a scene is submitted from outside, a worker is killed in the middle, and
# the pixels must be the same, bit for bit.
#
# usage: tests/compose.sh PATH/TO/lightfarm      needs the static binary of the Dockerfile; prints one line per check
set -euo pipefail

lightfarm=$(realpath "${1:?usage: tests/compose.sh PATH/TO/lightfarm}")
cd "$(dirname "$0")/.."
scene=$PWD/scenes/cornell.toml

if docker compose version >/dev/null 2>&1; then
    compose=(docker compose)
elif docker-compose version >/dev/null 2>&1; then
    compose=(docker-compose)
else
    echo "neither 'docker compose' nor 'docker-compose' is installed" >&2
    exit 1
fi

export LIGHTFARM_IMAGE=lightfarm-test-$$
export LIGHTFARM_TOKEN=token-$RANDOM-$RANDOM
export LIGHTFARM_PORT=$((20000 + RANDOM % 20000))
export LIGHTFARM_COORDINATOR=http://127.0.0.1:$LIGHTFARM_PORT
project=(-p "lightfarm-test-$$" -f "$PWD/docker-compose.yml")
work=$(mktemp -d)

finish() {
    status=$?
    if [ $status -ne 0 ]; then
        "${compose[@]}" "${project[@]}" logs --no-color --tail 40 || true
    fi
    "${compose[@]}" "${project[@]}" down --volumes --timeout 10 >"$work/down.log" 2>&1 || cat "$work/down.log"
    docker rmi -f "$LIGHTFARM_IMAGE" >/dev/null 2>&1 || true
    rm -rf "$work"
    exit $status
}
trap finish EXIT

# Waits until a command succeeds, for at most $1 seconds.
await() {
    local deadline=$((SECONDS + $1))
    shift
    until "$@"; do
        if [ $SECONDS -ge $deadline ]; then
            echo "gave up waiting for: $*" >&2
            return 1
        fi
        sleep 0.2
    done
}

"${compose[@]}" "${project[@]}" up --build --detach >"$work/up.log" 2>&1 || { cat "$work/up.log"; exit 1; }

two_workers() {
    [ "$("$lightfarm" workers --json 2>/dev/null | grep -o '"state":"[a-z]*"' | grep -vc lost)" -ge 2 ]
}
await 60 two_workers
echo "ok: two workers dialled in, by the coordinator's name"

if LIGHTFARM_TOKEN=wrong "$lightfarm" jobs >/dev/null 2>&1; then
    echo "a wrong token was let in" >&2
    exit 1
fi
echo "ok: a wrong token is refused"

for integrator in path light; do
    options=(--integrator "$integrator" --spp 48 --size 256x256 --seed 7)
    job=$("$lightfarm" submit "$scene" "${options[@]}")

    # Kill a worker when a part of the job is done, but not all of it.
    under_way() { "$lightfarm" show "$job" --json | grep -Eq '"fraction":0\.[0-9]*[1-9]'; }
    await 120 under_way
    victim=$("${compose[@]}" "${project[@]}" ps -q worker-1)
    docker kill "$victim" >/dev/null
    "$lightfarm" show "$job" --json >"$work/show.json"
    if ! grep -Eq '"fraction":0\.' "$work/show.json"; then
        echo "the job was over before the worker was killed" >&2
        exit 1
    fi
    echo "ok: $integrator: killed a worker at $(grep -Eo '"fraction":0\.[0-9]{0,3}' "$work/show.json" | head -1)"

    "$lightfarm" watch "$job" >"$work/watch.log" 2>&1 || { cat "$work/watch.log"; exit 1; }
    "$lightfarm" fetch "$job" -o "$work/farm.exr" >"$work/fetch.log"
    "$lightfarm" render "$scene" "${options[@]}" -o "$work/alone.exr" >"$work/render.log" 2>&1 || { cat "$work/render.log"; exit 1; }
    "$lightfarm" diff "$work/farm.exr" "$work/alone.exr" --bit-exact
    echo "ok: $integrator: the farm's pixels are those of lightfarm render"

    "${compose[@]}" "${project[@]}" up --detach worker-1 >"$work/up.log" 2>&1 || { cat "$work/up.log"; exit 1; }
    await 60 two_workers
done

#!/bin/sh
# Describes a corpus in 16 shards, as many at once as this machine has cores; run it again and it goes on where it
# stopped. On several machines with a common folder, GNU parallel takes the same command: seq 16 | parallel -S ...
#   sh examples/scale/parallel.sh MOTIONS PARTS
seq 16 | xargs -P "$(nproc)" -I '{}' motet describe "$1" --parts "$2" --jobs 1 --shard '{}/16'
motet merge "$2" --out "$2.jsonl"

#!/bin/sh
#SBATCH --job-name=motet-describe
#SBATCH --array=1-16
#SBATCH --cpus-per-task=4
#SBATCH --mem=4G
#SBATCH --requeue
# Describes a corpus by an array of 16 jobs; a job that is started again goes on where it stopped:
#   job=$(sbatch --parsable examples/scale/slurm.sh MOTIONS PARTS)
#   sbatch --dependency=afterany:$job --wrap "motet merge PARTS --out answers.jsonl"
exec motet describe "$1" --parts "$2" --shard "$SLURM_ARRAY_TASK_ID/16" --jobs "${SLURM_CPUS_PER_TASK:-1}"

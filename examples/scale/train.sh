#!/bin/sh
#SBATCH --job-name=motet-train
#SBATCH --nodes=2
#SBATCH --ntasks-per-node=1
#SBATCH --requeue
# Trains on two machines that share a folder, a process for each of their GPUs (PROCESSES, 1 by default):
#   sbatch examples/scale/train.sh describe --data store --out run --resume
# --resume goes on from the last checkpoint, if there is one, where the job is started again.
first=$(scontrol show hostnames "$SLURM_JOB_NODELIST" | head -n 1)
exec srun torchrun --nnodes "$SLURM_NNODES" --nproc-per-node "${PROCESSES:-1}" --rdzv-id "$SLURM_JOB_ID" \
    --rdzv-backend c10d --rdzv-endpoint "$first:29500" -m motet train "$@"

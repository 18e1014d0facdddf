#!/bin/sh
# Four shares of a study, then what they found:
#   job=$(sbatch --parsable examples/study_slurm.sh)
#   sbatch --dependency=afterok:$job --wrap="python examples/study_slurm.py merge"
#SBATCH --job-name=study
#SBATCH --array=0-3
#SBATCH --cpus-per-task=4
#SBATCH --time=00:10:00

export MODFUN_NUM_THREADS="${SLURM_CPUS_PER_TASK:-1}"
python examples/study_slurm.py "$SLURM_ARRAY_TASK_ID" "$SLURM_ARRAY_TASK_COUNT"

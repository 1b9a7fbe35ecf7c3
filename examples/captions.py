"""A sentence for each BVH file of a folder: python examples/captions.py FOLDER > captions.csv"""

import csv
import sys
from pathlib import Path

import motet
from motet.errors import MotetError

if len(sys.argv) != 2:
    sys.exit(__doc__)
model = motet.load("describe")
table = csv.writer(sys.stdout)
for path in sorted(Path(sys.argv[1]).rglob("*.bvh")):
    try:
        best = model.describe(motet.read(path))[0]
    except MotetError as error:  # a file that is damaged, or no human's
        print(error, file=sys.stderr)
    else:
        table.writerow([path.name, best.text if best.confident else ""])

"""The table of sentences that `generate` is trained on: those of the recordings, and those of the hand-keyed clips that
show an act which no recording shows, with what the clips' own table says of each.

    python docs/results/hand_keyed.py sentences.tsv sentences-cc0.tsv cc0-clips.zip > sentences-acts.tsv

Left out are gaits in place, twins of clips that travel, parts of acts, as of a jump, and acts that people recorded.
"""

import csv
import io
import sys
import zipfile
from pathlib import Path

CLIPS = """
Angry Confused Crawl_RM Death01 Dizzy Driving_Loop Fixing_Kneeling Flying_Forward Flying_Forward_Super Head_Nod
Hit_Chest Hit_Head Idle_Torch_Loop Interact Jumping_Jacks Kneeling_Tired Levitate_Entrance Levitate_Idle
Meditate PickUp_Table Pistol_Idle_Loop Pistol_Reload Pistol_Shoot Power_Up Push_Loop Pushup Reject Roll_RM
Sitting_Idle_Loop Sitting_Talking_Loop Sleeping Spell_Simple_Idle_Loop Spell_Simple_Shoot Swim_Fwd_Loop
Swim_Idle_Loop Throw_Object Tired_Hunched Two_hand_Blast
"""
COLUMNS = ("clip", "description", "sentence", "pool", "in_place", "loops")


class Plain(csv.excel_tab):
    """Columns parted by tabs, without quoting."""

    quoting, quotechar, lineterminator = csv.QUOTE_NONE, None, "\n"


def rows(text: str) -> list[dict[str, str]]:
    """The rows of a table by column."""
    return list(csv.DictReader(io.StringIO(text), dialect=Plain))


def main(recorded: str, keyed: str, clips: str) -> None:
    """Write the table on stdout."""
    with zipfile.ZipFile(clips) as archive:
        about = {row["clip"]: row for row in rows(archive.read("clips.tsv").decode())}
    writer = csv.DictWriter(sys.stdout, COLUMNS, dialect=Plain)
    writer.writeheader()
    writer.writerows(rows(Path(recorded).read_text(encoding="utf-8")))
    shown = {f"CC0_{name}" for name in CLIPS.split()}
    for row in (row for row in rows(Path(keyed).read_text(encoding="utf-8")) if row["clip"] in shown):
        told = {name: about[row["clip"]][name].replace("no", "") for name in ("in_place", "loops")}
        writer.writerow({**row, **told})


if __name__ == "__main__":
    main(*sys.argv[1:])

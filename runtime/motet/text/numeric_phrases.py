"""Numbers in sentences: "turns left 30 degrees", "two steps back", "jumps twice" as typed quantities, and what remains.

Number words become digits, other ways to say a number and its unit become the usual one, then a number before a unit or
before something that is counted is a quantity. Anything else stays a word of the sentence.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, NamedTuple

from motet.errors import TextError
from motet.text.clauses import stem
from motet.text.vocabulary import NEW_MODEL_RULES, NUMBER_WORDS

Kind = Literal["degrees", "metres", "steps", "times", "seconds", "pace"]
"""degrees: of a turn of the whole figure, to the left; negative to the right. pace: relative to the usual speed."""

LARGEST_NUMBERS: Mapping[Kind, float] = {"degrees": 3600, "metres": 200, "steps": 200, "times": 50, "seconds": 600}
"""The largest number of each kind that is accepted."""

WHOLE_TURN = r"(?:turn|circle|rotation|revolution|spin|twirl|pirouette|lap)s?"
SIZE = r"(?:(?:small|little|tiny|short|big|large|long|giant|quick|slow|more|baby) )?"
UNIT_SPELLINGS: tuple[tuple[Kind, float, str], ...] = (
    ("degrees", 1, r"deg(?:ree)?s?"),
    ("degrees", 360, rf"(?:(?:full|whole|complete) )?{WHOLE_TURN}"),
    ("metres", 1, r"m|met(?:er|re)s?"),
    ("metres", 0.01, r"cm|centimet(?:er|re)s?"),
    ("metres", 1000, r"km|kilomet(?:er|re)s?"),
    ("metres", 0.3048, r"foot|feet|ft"),
    ("metres", 0.9144, r"yards?|yds?"),
    ("steps", 1, rf"{SIZE}(?:foot)?(?:step|pace|stride)s?"),
    ("seconds", 1, r"s|secs?|seconds?"),
    ("seconds", 60, r"mins?|minutes?"),
    ("times", 1, r"times?|x"),
)
"""Units of numbers: the kind, its amount in a unit, and the spellings of the unit."""

REPEATED = "jump|hop|clap|nod|kick|punch|jab|squat|bow|stomp|spin|wave"
"""Acts that may be said as often as they are to be done."""

SPELLED = "|".join([*NUMBER_WORDS, "hundred"])
MEASURES = "|".join(unit for kind, _, unit in UNIT_SPELLINGS if kind in ("metres", "steps", "seconds"))
REWORDED_NUMBERS: tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...] = (
    (rf"\b(?:a )?(?:{SPELLED})(?:(?:[ -]| and )(?:{SPELLED}))*\b", lambda match: NEW_MODEL_RULES.normalise(match[0])),
    (r"\u2212(?=\d)", "-"),
    (r"[\u00b0\u00ba]", " degrees "),
    (r"(\d?)\u00bd", lambda match: f"{match[1] or 0}.5"),
    (r"(?<=\d),(?=\d{3}\b)", ""),
    (r"\b(?:10 ?\^ ?|1e)(\d{1,2})\b", lambda match: "1" + "0" * int(match[1])),
    (r"\b(\d+) thousand\b", r"\g<1>000"),
    (r"\b(\d+) million\b", r"\g<1>000000"),
    (r"\b(?:at )?a right angle\b", "90 degrees"),
    (r"\ba couple(?: of)?\b", "2"),
    (r"\ba few\b", "3"),
    (r"\bhalf a dozen\b", "6"),
    (r"\b(?:a )?dozen\b", "12"),
    (r"\btwice\b(?! as\b)", "2 times"),
    (r"\bthrice\b", "3 times"),
    (rf"^({REPEATED})(?:[ ,]+\1)+$", lambda match: f"{match[1]} {len(re.findall(match[1], match[0]))} times"),
    (r"(?<= )x ?(\d+)\b", r"\1 times"),
    (r"(?<!at )\bonce\b(?! more| again)", "1 time"),
    (r"\b(?:a )?single\b", "1"),
    (r"\b(do|does|doing|performs?) (?=(?:squat|lunge|cartwheel|burpee|sit-?up|pull-?up)s\b)", r"\1 4 "),
    (r"\b(\d+)[ -]and[ -]a[ -]half\b", r"\1.5"),
    (rf"\b(?:an?|1) ({MEASURES}) and a half\b", r"1.5 \1"),
    (r"\b3[ -]quarters?(?: of)?(?: an?)?\b", "0.75"),
    (r"\b(?:an? |1 )?quarter(?: of)?(?: an?)?(?=[ -])", "0.25"),
    (r"\b(?:an? )?half(?: an?)?(?=[ -])", "0.5"),
    (rf"\b(?:an? )?(?:full|whole|complete) (?={WHOLE_TURN}\b)", "1 "),
    (r"\bin an? ((?:counter-?|anti-?)?clockwise) circle\b", r"\1 1 circle"),
    (r"\bin (?:an? )?(?:(?:big|small|large|wide|tight|full|complete|whole) )?circles?\b", "1 circle"),
    (rf"\ban? (?=(?:{MEASURES})\b)", "1 "),
    (r"\b(?:does|do) an? (45|90|135|180|270|360|540|720)\b(?! deg)", r"turn \1"),
    (r"\b(turn\w*|rotat\w*|spin\w*|pivot\w*) (45|90|135|180|270|360|540|720)\b(?! deg)", r"\1 \2 deg"),
    (r"\b(?:an? )?(45|90|135|180|270|360|540|720) (turn|spin|pivot)\b", r"\2 \1 deg"),
    (r"\b(?:retreats?|backs? (?:off|away|up)) (?=\d)", "walks backwards "),
    (r"\badvances? (?=\d)", "walks forward "),
)  # fmt: skip
"""Other ways to say numbers and their units, and their replacements."""

LEADING = r"(?:\b(?:for|by|about|roughly|exactly|only|just|in|within|over|of|another|an?|the)\s+)*"
QUANTITY = re.compile(
    rf"{LEADING}(?<![\w.-])(?P<number>-?\d+(?:\.\d+)?)[\s-]*"
    rf"(?:{'|'.join(f'(?P<u{i}>{unit})' for i, (*_, unit) in enumerate(UNIT_SPELLINGS))})\b"
    r"(?!\s*(?:/|per\b|high|tall|apart|off))"
)
"""A number and its unit, with the words before it that belong to it."""

COUNTED_ACTS: Mapping[str, str] = {
    **dict.fromkeys(("jump", "hop", "leap", "bounc"), "jumps"),
    **dict.fromkeys(("jack",), "jacks"),
    **dict.fromkeys(("kick",), "kicks"),
    **dict.fromkeys(("punch", "jab", "hook", "uppercut", "cross"), "punches"),
    **dict.fromkeys(("squat", "crouch", "kneel", "lung", "sit"), "dips"),
    **dict.fromkeys(("bow",), "bows"),
    **dict.fromkeys(("wav",), "waves"),
    **dict.fromkeys(("nod",), "nods"),
    **dict.fromkeys(("clap", "applaud"), "claps"),
    **dict.fromkeys(("pushup", "pressup"), "pushups"),
    **dict.fromkeys(("cartwheel", "flip", "backflip", "roll", "push", "press", "throw", "swing"), ""),
}
"""Stems of words for acts that are repeated, and the measure that counts them
(:mod:`motet.generate.motion_measures`); "" for acts that are counted by their beginnings."""


COUNT_OF_ACTS = re.compile(
    rf"(?P<doing>\b(?:do|does|doing|performs?)\s+)?(?<![\w.-])(?P<number>-?\d+)\s+"
    rf"(?P<what>(?:[a-z-]+\s+){{0,2}}?(?:(?:{'|'.join(COUNTED_ACTS)})\w*|(?(doing)[a-z]+s|(?!)))\b)"
)
"""A number of acts: "two squats", "does 3 cartwheels"."""

REMAINING_WORD = {"step": "steps", "pace": "steps", "stri": "steps", "turn": "turn", "spin": "turn", "rota": "turn"}
"""The word that remains of a unit, by its first letters."""

ON_FEET = re.compile(r"(?:on|with|off|from|lifts?|raises?|puts?|both|the)\s*$|^1$")
"""Words before a number of feet, or the number, that mean the figure's feet."""

BODY_PARTS = re.compile(
    r"\b(?:arm|hand|fist|leg|knee|head|shoulder|elbow|hip|waist|trunk|torso|finger|wrist|back|body)s?\b"
)
MOVING = re.compile(
    r"\b(?:turn|rotat|spin|pivot|twirl|circl|veer|curv|walk|r[ua]n|jog|go|stride|march|step|climb|crawl|hop|jump|skip|leap|sneak)\w*"
)
SIDE_PHRASES = re.compile(
    r"\b(?:(left|anti-?clockwise|counter-?clockwise)|(right|clockwise))\b(?! (?:arm|hand|fist|leg|foot|knee|side of))"
)
PACE_PHRASES = re.compile(
    r"\b(?:(?:very|really|so|super|extremely) )?"
    r"(?:(slow(?:ly|er)?)|(?:fast(?:er)?|quick(?:ly|er)?|rapidly|briskly|hastily|hurriedly|swiftly"
    r"|as fast as (?:possible|(?:you|he|she|it|they|one) can)))\b"
)
SLOWER = 0.75
FASTER = 1.3


ELSEWHERE = (
    r"\b(?:spot|place|stand\w*|walk\w*|r[ua]n\w*|jog\w*|skip\w*|hop\w*|jump\w*|leap\w*|danc\w*|sit\w*|crawl\w*)\b"
)
"""Words for the manner of a turn."""

UNSAID: Mapping[Kind, str] = {"steps": "walk forward", "metres": "walk forward", "degrees": "turn around"}
"""The action of a sentence that says nothing but a number."""


@dataclass(frozen=True)
class Quantities:
    """The numbers in a sentence."""

    text: str
    """The sentence without them."""

    amounts: Mapping[Kind, float] = field(default_factory=dict)
    """The amount of each kind."""

    either: bool = False
    """Whether a turn may be to either side."""

    act: str = ""
    """The measure of the act that is repeated, a value of :data:`COUNTED_ACTS`; "" for one counted by its
    beginnings."""

    spot: str = ""
    """The sentence without the numbers and "on the spot", as words alone: a turn without a gait, which ``text`` makes
    walking."""


def numerals(sentence: str) -> str:
    """A sentence in lower case with numbers as digits: "half a turn" is "0.5 turn", "twice" is "2 times"."""
    text = sentence.lower()
    for pattern, replacement in REWORDED_NUMBERS:
        text = re.sub(pattern, replacement, text)
    return text


@lru_cache(maxsize=256)
def quantities_of(sentence: str) -> Quantities:
    """The quantities of a sentence, the first of each kind; TextError for an impossible one: "-3 jumps"."""
    # the first phrase of each kind, left to right; phrases do not overlap
    text = numerals(sentence)
    amounts: dict[Kind, float] = {}
    phrases: list[_Phrase] = []
    for phrase in sorted(_phrases(text), key=lambda phrase: phrase.start):
        if phrase.kind not in amounts and all(phrase.start >= earlier.stop for earlier in phrases):
            amounts[phrase.kind] = _sensible(phrase.kind, phrase.amount, sentence)
            phrases.append(phrase)
    # what is left of the sentence without their numbers; from the end, so that places stay
    for phrase in reversed(phrases):
        text = text[: phrase.start] + phrase.rest + text[phrase.stop :]
    # sides and paces have no numbers
    sides = {1 if left else -1 for left, _ in SIDE_PHRASES.findall(text)}
    _turned(text, amounts, sides)
    if "degrees" in amounts:  # which way is in their sign
        text = re.sub(r"\b(?:anti-?|counter-?)?clockwise\b", "", text)
    if pace := PACE_PHRASES.search(text):
        amounts["pace"] = SLOWER if pace[1] else FASTER
    remaining = _plain(text, amounts) if phrases or "degrees" in amounts else sentence
    without_place = re.sub(r"\b(?:on the spot|in place)\b", "", text)
    spot = re.sub(r"\s+", " ", without_place).strip(" ,.")
    return Quantities(remaining, amounts, len(sides) != 1, _act_in(text), spot)


def _act_in(text: str) -> str:
    """The measure of the act that a text repeats, a value of :data:`COUNTED_ACTS`."""
    words = re.findall("[a-z]+", re.sub(r"\b(push|press|sit|pull)[ -]?ups?\b", r"\1up", text))
    acts = [COUNTED_ACTS[word] for word in map(stem, words) if word in COUNTED_ACTS]
    return "jacks" if "jacks" in acts else next(filter(None, acts), "")


def known_turns(quantities: Quantities) -> list[str]:
    """Texts with other angles, the nearest first: actions are known by right angles and their halves, and a turn made
    while walking is turned best."""
    turn = abs(quantities.amounts.get("degrees", 0))
    if not 20 <= turn <= 240:
        return []
    angles = sorted((45, 90, 135, 180), key=lambda angle: abs(angle - turn))
    return [f"{quantities.text} {angle} degrees" for angle in angles]


class _Phrase(NamedTuple):
    """A quantity in a text: from ``start`` to ``stop``, where ``rest`` remains."""

    kind: Kind
    amount: float
    start: int
    stop: int
    rest: str


def _phrases(text: str) -> Iterator[_Phrase]:
    """The quantities in a text, units before acts."""
    for match in QUANTITY.finditer(text):
        place = next(i for i in range(len(UNIT_SPELLINGS)) if match[f"u{i}"])
        kind, factor, _ = UNIT_SPELLINGS[place]
        unit = match[f"u{place}"]
        before = text[: match.start()]
        verb_ends = [verb.end() for verb in MOVING.finditer(before)]
        # An angle or a length of a part of the body, the figure's own feet, and "after 3 steps" are no quantities.
        of_body = kind in ("degrees", "metres") and BODY_PARTS.search(before, verb_ends[-1] if verb_ends else 0)
        of_feet = unit in ("foot", "feet") and (ON_FEET.search(before) or match["number"] == "1")
        if of_body or of_feet or re.search(r"\b(?:after|every|each)\s*$", before):
            continue
        rest = "" if verb_ends and kind == "degrees" else REMAINING_WORD.get(unit.split()[-1][:4], "")
        yield _Phrase(kind, factor * float(match["number"]), match.start(), match.end(), f" {rest} ")
    for match in COUNT_OF_ACTS.finditer(text):
        yield _Phrase("times", float(match["number"]), match.start("number"), match.start("what"), "")


def _sensible(kind: Kind, value: float, sentence: str) -> float:
    least = -LARGEST_NUMBERS[kind] if kind == "degrees" else 0
    if not least <= value <= LARGEST_NUMBERS[kind] or value == 0 or (kind in ("steps", "times") and value % 1):
        whole = "a whole number" if kind in ("steps", "times") else "a number"
        raise TextError(
            f"{value:g} {kind} cannot be shown (in {sentence!r}): "
            f"give {whole} other than 0, at most {LARGEST_NUMBERS[kind]:g}"
        )
    return value


def _turned(text: str, amounts: dict[Kind, float], sides: set[int]) -> None:
    """Make turns degrees, with the sign of their side: "turns around" is half a turn, once for each time."""
    around = re.search(r"\bturn\w*(?: all the way)? around\b", text)
    if "degrees" not in amounts and (around or re.search(r"\b(?:spin|rotat|twirl|whirl|pirouett)\w*\b", text)):
        if "times" in amounts:
            amounts["degrees"] = 360 * amounts.pop("times")
        elif around:
            amounts["degrees"] = 360 if "all the way" in around[0] else 180
    elif "degrees" in amounts and "times" in amounts:
        amounts["degrees"] *= amounts.pop("times")
    elif "times" in amounts and re.search(r"\bstep(?:s|ping)?\b", text) and "steps" not in amounts:
        amounts["steps"] = amounts.pop("times")
    if "degrees" in amounts and sides == {-1}:
        amounts["degrees"] *= -1


def _plain(text: str, amounts: Mapping[Kind, float]) -> str:
    """A text without numbers: steps and turns are made walking, unless it says something else of them."""
    if "steps" in amounts and not re.search(r"\b(?:left|right|side\w*)\b", text):
        steps = r"\b(?:(?:takes?|taking|makes?|does|do)\s+)?steps\b"
        alone = not MOVING.search(re.sub(steps, "", text))
        text = re.sub(steps, "walks" if alone else "", text)
    if 20 <= abs(amounts.get("degrees", 0)) <= 240 and not re.search(ELSEWHERE, text):
        text = re.sub(r"\b(?:(?:makes?|do|does)\s+)?(?:turn|pivot|rotat|veer)\w*", "walks and turns", text)
    text = re.sub(r"\s+", " ", text).strip(" ,.")
    text = re.sub(r"\bwalk(s|ing)?$", r"walk\1 forward", text)
    return text or next(UNSAID[kind] for kind in (*amounts, "steps") if kind in UNSAID)

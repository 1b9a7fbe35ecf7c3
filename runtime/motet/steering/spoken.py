"""What a typed sentence asks a figure for: acts by name, orders to go, turn or stop, one after another or at once.

All words are in the table of the repertoire (:mod:`motet.steering.repertoire`), of which ``acts.toml`` of the training
says what they mean. A sentence is read whole or not at all: a word that is not known stops it, and the nearest names
are offered.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import chain
from typing import Any

from motet.steering.repertoire import Entry, document, entries
from motet.steering.styles import NO_STYLE
from motet.text.clauses import stem
from motet.text.spelling import corrected

SLOW_FACTOR = 0.65
FAST_FACTOR = 1.4
"""How many times as fast an act or a gait is that is to be slow or fast."""

JOG = 0.8
"""Of the usual speed of a run."""

MOST_TIMES = 10
"""Times that an act is done."""

STEP = 0.6
"""Seconds of a step."""

CURVE = 50.0
"""Degrees a second of a circle."""

OFFERED = 3
"""Names that are nearest to what is not known."""

# fmt: off
WORD_LISTS = (
    "idle", "everyone", "plural", "stop", "never", "slow", "fast", "loud", "then", "both", "times", "where", "articles",
    "compared",
)
# fmt: on
"""Names of the lists of words of the table."""

SHORTEST_MENDED = 4
"""Letters of the shortest word whose spelling is mended."""


@dataclass(frozen=True)
class Step:
    """A part of what is said.

    kind: "act", "go", "stop", "here" (come here) or "away". name: of the act, or of the gait, "" for the present one.
    side: of the act, "left" or "right", "" for that in which it is shown. tempo: of the act. count: how often it is
    done. style: in which it goes, "" for as recorded. pace: of the usual speed of that, 0 for the present speed.
    change: of the present speed. way: degrees to the left of the facing. aside: whether the facing stays. curve:
    degrees a second to the left. seconds: that it lasts, 0 where it stays. together: with the step before it. lacking:
    words that it leaves out, which say where.
    """

    kind: str
    name: str = ""
    side: str = ""
    tempo: float = 1.0
    count: int = 1
    style: str = ""
    pace: float = 0.0
    change: float = 1.0
    way: float = 0.0
    aside: bool = False
    curve: float = 0.0
    seconds: float = 0.0
    together: bool = False
    lacking: str = ""

    @property
    def is_turn(self) -> bool:
        """Whether it turns on the spot."""
        return self.kind == "go" and not self.name and self.way != 0

    @property
    def caption(self) -> str:
        """What is answered: "wave (left, slowly, twice)"."""
        if self.kind == "act":
            details = [self.side] if self.side else []
            details += ["slowly"] if self.tempo < 1 else ["fast"] if self.tempo > 1 else []
            details += [] if self.count == 1 else ["twice"] if self.count == 2 else [f"{self.count} times"]
            details += [f"without '{self.lacking}'"] if self.lacking else []
            return f"{self.name} ({', '.join(details)})" if details else self.name
        return {"stop": "stop", "here": "come here", "away": "go away"}.get(self.kind) or self._way_caption()

    def _way_caption(self) -> str:
        words = [self.name] if self.name else []
        if self.pace not in (0.0, 1.0):
            words.append("slowly" if self.pace < JOG else "fast" if self.pace > 1 else "at a jog")
        if self.change != 1:
            words.append("faster" if self.change > 1 else "slower")
        if self.curve:
            words.append("in a circle")
        if self.aside:
            words.append({180.0: "backwards", 90.0: "sideways left"}.get(self.way, "sideways right"))
        elif self.way:
            side = "left" if self.way > 0 else "right"
            words.append("turn around" if abs(self.way) == 180 else f"turn {side}")
            words += [] if abs(self.way) in (90, 180) else [f"{abs(self.way):g} degrees"]
        words += [f"({self.style})"] if self.style else []
        words += [f"(without '{self.lacking}')"] if self.lacking else []
        return " ".join(words)


ORDER_PHRASES = {
    "here": Step("here"),
    "away": Step("away"),
    "around": Step("go", way=180.0),
    "faster": Step("go", change=FAST_FACTOR),
    "slower": Step("go", change=SLOW_FACTOR),
}
"""What phrases mean that are not read word by word."""


@dataclass(frozen=True)
class Reading:
    """What a sentence is read as: ``steps``, or ``unknown``, the part that is not known, and ``nearest``, names that
    can be said. everyone: whether it is said to all. mended: misspelt words and what they are read as."""

    steps: tuple[Step, ...] = ()
    unknown: str = ""
    nearest: tuple[str, ...] = ()
    everyone: bool = False
    mended: Mapping[str, str] = field(default_factory=dict)

    @property
    def caption(self) -> str:
        """What is answered to it."""
        if not self.steps:
            what = f"'{self.unknown}' is not known" if self.unknown else "Nothing is said"
            return f"? {what}. Nearest: {', '.join(self.nearest)}."
        text = ""
        for step in self.steps:
            text += (" and " if step.together else ", then ") if text else ""
            text += step.caption
        mended = ", ".join(f"'{word}' read as '{read_as}'" for word, read_as in self.mended.items())
        return f"{text}: {mended}" if mended else text


class Words:
    """The words of a document of the repertoire, and what is read in them."""

    def __init__(self, table: Mapping[str, Any], acts: Mapping[str, Entry], gaits: Sequence[str]) -> None:
        self.table = table
        self.acts = acts
        self.gaits = gaits
        self.idle = frozenset(table["idle"])
        # of each phrase what its words share, and what it means
        self.by_key = self._keyed({act.name: act.phrases for act in acts.values()})
        self.orders = self._keyed(table["phrases"])
        self.still = self._keyed({"stop": table["still"]})
        self.kinds = self._kinds()
        self.styles = self._styles()
        # words that may be said beside an act or an order, and all that are known
        self.limbs = frozenset(chain.from_iterable(act.limbs for act in acts.values()))
        self.manner = frozenset(chain(*(table[name] for name in ("slow", "fast", "loud", "times", "counts"))))
        self.known = tuple(dict.fromkeys(self._all_words()))
        self.stems = frozenset(map(stem, self.known))

    def _kinds(self) -> dict[str, str]:
        """Of each word of an order, by its stem, its kind, which for a gait is its name."""
        kinds = dict[str, str]()
        for kind, words in self.table["orders"].items():
            kinds |= dict.fromkeys(map(stem, words), kind)
        return kinds | {stem(gait): gait for gait in self.gaits}

    @cached_property
    def style_keys(self) -> dict[str, str]:
        """Key -> style, of the phrases of each style."""
        return self._keyed(self.table["styles"])

    def _styles(self) -> list[tuple[frozenset[str], bool, str]]:
        """Of each phrase for a style, the longest first, what its words share but for a gait, whether it names one, and
        the style; without those that mean no more than a pace."""
        passed = {*self.kinds, *map(stem, (*self.table["slow"], *self.table["fast"]))}
        styles = list[tuple[frozenset[str], bool, str]]()
        for key, name in self.style_keys.items():
            roots = frozenset(key.split())
            gaits = frozenset(root for root in roots if self.kinds.get(root) in self.gaits)
            if not roots <= passed:
                styles.append((roots - gaits, bool(gaits), name))
        return sorted(styles, key=lambda style: -len(style[0]))

    def _keyed(self, meanings: Mapping[str, Iterable[str]]) -> dict[str, str]:
        """Key -> meaning, of the phrases of each meaning."""
        keyed = dict[str, str]()
        for meaning, phrases in meanings.items():
            keyed |= dict.fromkeys(map(self.key, phrases), meaning)
        return keyed

    def _all_words(self) -> Iterator[str]:
        for name in WORD_LISTS:
            yield from self.table[name]
        for group in ("counts", "sides", "orders"):
            for name, words in self.table[group].items():
                yield name
                yield from words if isinstance(words, list) else ()
        yield from self.gaits
        phrases = [act.phrases for act in self.acts.values()]
        orders = (*self.table["phrases"].values(), *self.table["styles"].values())
        for phrase in chain(*phrases, self.table["still"], *orders):
            yield from words_of(phrase)

    def key(self, words: str | Iterable[str]) -> str:
        """What a phrase shares with others of the same words: their stems without idle ones, sorted."""
        each = words_of(words) if isinstance(words, str) else words
        return " ".join(sorted({self.root(word) for word in each if word not in self.idle}))

    def root(self, word: str) -> str:
        """What the forms of a word share: one hand is not two hands."""
        return word if word in self.table["plural"] else stem(word)

    def read(self, text: str) -> Reading:
        """What a sentence is read as."""
        words = words_of(text)
        everyone = any(word in self.table["everyone"] for word in words)
        mended = dict[str, str]()
        words = [self._mended(word, mended) for word in words if word not in self.table["everyone"]]
        steps = list[Step]()
        for clause in self._clauses(words):
            part = self._other_side(clause, steps) or self._together(clause)
            if isinstance(part, str):
                return Reading(unknown=part, nearest=self.nearest(part), everyone=everyone)
            steps += part
        if not steps:
            return Reading(nearest=self.nearest(""), everyone=everyone)
        return Reading(tuple(steps), everyone=everyone, mended=mended)

    def _clauses(self, words: Sequence[str]) -> list[list[str]]:
        """The parts of words that follow each other; "twice" or "slowly" after a comma belongs to the part before."""
        clauses = list[list[str]]()
        for clause in _split(words, (*MARKS, *self.table["then"])):
            meant = [word for word in clause if word not in self.idle]
            if clauses and all(word in self.manner for word in meant):
                clauses[-1] += clause
            elif meant:
                clauses.append(clause)
        return clauses

    def _mended(self, word: str, mended: dict[str, str]) -> str:
        """A word, or the known one that it is a misspelling of."""
        if len(word) < SHORTEST_MENDED or not word.isalpha() or word in self.known or stem(word) in self.stems:
            return word
        read_as = corrected(word, self.known)
        if read_as:
            mended[word] = read_as
        return read_as or word

    def _other_side(self, words: Sequence[str], steps: Sequence[Step]) -> list[Step]:
        """The last of steps once more on the side that words are alone with: "wave with your left hand, then the
        right one"; none for other words."""
        meant = [word for word in self._without_sides(words) if word not in self.idle and word != "one"]
        side = self._side(words)
        if not side or not steps or not self.limbs.issuperset(meant):
            return []
        last = steps[-1]
        is_sided = last.kind == "act" and self.acts[last.name].side
        return [replace(last, side=side, together=False)] if is_sided else []

    def _together(self, words: Sequence[str]) -> list[Step] | str:
        """The steps of words that are done at once, "A and B", but for acts, of which one follows the other; what of
        them is not known."""
        parts = [part for part in _split(words, self.table["both"]) if part]
        steps = list[Step]()
        if self._stops_first(parts):
            steps.append(Step("stop"))
            parts = parts[1:]
        else:
            whole = self._one(words)
            if whole is not None:
                return [whole]
        while parts:
            step, count = self._longest(parts)
            if step is None:
                return " ".join(parts[0])
            steps.append(replace(step, together=bool(steps) and _is_done_with(step, steps[-1])))
            parts = parts[count:]
        return steps

    def _stops_first(self, parts: Sequence[Sequence[str]]) -> bool:
        """Whether parts begin with a stop, and go on with something else than what is stopped: "stop and wave" is no
        "stop walking and waving"."""
        first_words = list[str]()
        for part in parts[:2]:
            first_words += [word for word in part if word not in self.idle][:1]
        if len(first_words) < 2:
            return False
        return first_words[0] in self.table["stop"] and not first_words[1].endswith("ing")

    def _longest(self, parts: Sequence[Sequence[str]]) -> tuple[Step | None, int]:
        """The step of as many parts as make sense together, as in "look left and right", or of the first one without
        its place; and how many these are."""
        for count in range(len(parts), 0, -1):
            step = self._one(list(chain(*parts[:count])))
            if step is not None:
                return step, count
        return self._gone_somewhere(parts[0]), 1

    def _one(self, all_words: Sequence[str]) -> Step | None:
        """The step of words; None where they are not known."""
        words = [word for word in all_words if word not in self.idle]
        key = self.key(words)
        order = self.orders.get(key)
        if order is not None:
            return ORDER_PHRASES[order]
        # "march forward" is a style, not the act on the spot
        act = None if key in self.style_keys and key not in self.by_key else self._act(words)
        if act is not None:
            return act
        stops = words and (words[0] in self.table["stop"] or any(word in self.table["never"] for word in words))
        if stops or (key and key in self.still):
            return Step("stop")
        return self._styled_order(words) or self._order(words)

    def _gone_somewhere(self, all_words: Sequence[str]) -> Step | None:
        """The act or order of words before a place or a comparison, which it leaves out, as in "limp to the door"."""
        for at, word in enumerate(all_words[1:-1], start=1):
            is_compared = word in self.table["compared"]
            if is_compared or (word in self.table["where"] and all_words[at + 1] in self.table["articles"]):
                paces = (*self.table["slow"], *self.table["fast"])
                place = [after for after in all_words[at:] if after not in paces]
                order = [*all_words[:at], *(after for after in all_words[at:] if after in paces)]
                step = self._one(order)
                return replace(step, lacking=" ".join(place)) if step and step.name else None
        return None

    def _act(self, words: Sequence[str]) -> Step | None:
        """The act of words, with its side, tempo and count."""
        for tried, times, is_sided in self._tries(words):
            side = self._side(words) if is_sided else ""
            name = self._named(tried, side, is_sided)
            if name:
                tempo = 1.0 if tried is words else self._tempo(words)
                return Step("act", name, side, tempo, max(1, min(times, MOST_TIMES)))
        return None

    def _tries(self, words: Sequence[str]) -> Iterator[tuple[Sequence[str], int, bool]]:
        """Words as they are said, then without what may be said beside a name: a tempo, a number, a side, "loudly"; how
        often that is then, and whether it has a side."""
        yield words, 1, False
        # without tempo, then without numbers, then without sides
        timeless, count = self._without_times(words)
        plain = [word for word in timeless if word not in (*self.table["slow"], *self.table["fast"])]
        numbers = [number for number in map(self._number, plain) if number is not None]
        repeats = numbers[0] if numbers else count
        for beside in ((), self.table["loud"]):
            rest = [word for word in plain if word not in beside]
            fewer = [word for word in rest if self._number(word) is None]
            yield rest, count, False
            yield fewer, repeats, False
            yield self._without_sides(rest), count, True
            yield self._without_sides(fewer), repeats, True

    def _tempo(self, words: Sequence[str]) -> float:
        if any(word in self.table["fast"] for word in words):
            return FAST_FACTOR
        return SLOW_FACTOR if any(word in self.table["slow"] for word in words) else 1.0

    def _named(self, words: Sequence[str], side: str, is_sided: bool) -> str | None:
        """The act that words name, perhaps beside its limb; it has to have a side where one is said."""
        dropped = {word for word in words if word in self.limbs}
        bare = [word for word in words if word not in self.limbs]
        for tried, limbs in ((words, frozenset[str]()), (bare, dropped)):
            name = self.by_key.get(self.key(tried)) if tried else None
            if name is None or not limbs <= self.acts[name].limbs:
                continue
            if not is_sided or (side and self.acts[name].side):
                return name
        return None

    def _side(self, words: Sequence[str]) -> str:
        sides = [side for side, names in self.table["sides"].items() if not frozenset(names).isdisjoint(words)]
        return sides[0] if len(sides) == 1 else ""

    def _without_sides(self, words: Sequence[str]) -> list[str]:
        names = frozenset(chain(*self.table["sides"].values()))
        return [word for word in words if word not in names]

    def _without_times(self, words: Sequence[str]) -> tuple[list[str], int]:
        """Words without "twice" or "3 times", and how often that is."""
        rest = list(words)
        for at, word in enumerate(rest):
            number = self._number(word)
            if number is None:
                continue
            if at + 1 < len(rest) and rest[at + 1] in self.table["times"]:
                return rest[:at] + rest[at + 2 :], number
            if word in ("once", "twice", "thrice", "repeatedly"):
                return rest[:at] + rest[at + 1 :], number
        return rest, 1

    def _number(self, word: str) -> int | None:
        if word.isascii() and word.isdigit():
            return int(word[:6])
        number: int | None = self.table["counts"].get(word)
        return number

    def _order(self, words: Sequence[str]) -> Step | None:
        """The order of words to go, turn or change the pace; None for any other word among them."""
        side = self._side(words)
        pace = self._tempo(words)
        sorted_words = self._kinds_and_numbers(self._without_sides(words))
        if sorted_words is None:
            return None
        kinds, numbers = sorted_words
        has_unit = any(kind in kinds for kind in ("turn", "degrees", "step"))
        if len(numbers) > (1 if has_unit else 0):
            return None
        if not kinds and not side:
            return None if pace == 1 else Step("go", change=pace)
        if "faster" in kinds or "slower" in kinds:
            return None if side else Step("go", change=FAST_FACTOR if "faster" in kinds else SLOW_FACTOR)
        if kinds == ["turn"] and not side:
            return None
        return self._gone(kinds, side, numbers[0] if numbers else None, pace)

    def _styled_order(self, words: Sequence[str]) -> Step | None:
        """The order of words of which some name a style, as in "limp backwards"; None for any other."""
        roots = set(map(self.root, words))
        goes = any(self.kinds.get(root) in self.gaits for root in roots)
        for phrase, needs_gait, style in self.styles:
            if phrase <= roots and (goes or not needs_gait):
                rest = [word for word in words if self.root(word) not in phrase]
                step = self._order(rest if goes else [*rest, self.gaits[0]])
                return step and replace(step, style="" if style == NO_STYLE else style)
        return None

    def _kinds_and_numbers(self, words: Sequence[str]) -> tuple[list[str], list[int]] | None:
        """The kinds of the words of an order, and its numbers; None for a word that is neither, nor tells a manner."""
        passed = frozenset((*self.table["slow"], *self.table["fast"], *self.table["loud"]))
        kinds = list[str]()
        numbers = list[int]()
        timeless, count = self._without_times(words)
        for word in timeless:
            kind = self.kinds.get(stem(word))
            number = self._number(word)
            if kind is not None:
                kinds.append(kind)
            elif number is not None:
                numbers.append(number)
            elif word not in passed:
                return None
        # twice is two steps, or twice as many degrees
        if count != 1:
            usual = 1 if "step" in kinds else 90
            numbers = [count * number for number in numbers or [usual]]
        return kinds, numbers

    def _gone(self, kinds: Sequence[str], side: str, number: int | None, pace: float) -> Step | None:
        """The order of kinds of words, a side, a number and a pace."""
        sign = -1.0 if side == "right" else 1.0
        pace *= JOG if "jog" in kinds else 1.0
        gait = self._gait(kinds)
        steps = "step" in kinds
        degrees = 90.0 if number is None or steps else float(number)
        # no word of going: a turn
        if not gait and not any(kind in kinds for kind in GOING_KINDS):
            return Step("go", way=sign * (180.0 if "around" in kinds else degrees))
        # a way seen from the facing, or along a curve
        way, aside = _way(kinds, side, degrees)
        curve = sign * CURVE if "circle" in kinds else 0.0
        gone = Step("go", gait or self.gaits[0], pace=pace, way=way, aside=aside, curve=curve)
        return replace(gone, seconds=STEP * (number or 2)) if steps else gone

    def _gait(self, kinds: Sequence[str]) -> str:
        """The gait of kinds of words, "" for none: in "walk like a zombie" the later one of the figure's; a jog is a
        slow run."""
        named = [kind for kind in kinds if kind in self.gaits]
        return max(named, key=self.gaits.index, default="run" if "jog" in kinds else "")

    def nearest(self, text: str) -> tuple[str, ...]:
        """The names that are most like a text that is not known."""
        words = self._meant(text)
        stems = set(map(stem, words))
        pairs = _pairs(" ".join(words))
        scores = list[tuple[float, int, str]]()
        for at, act in enumerate(self.acts.values()):
            best = 0.0
            for phrase in act.phrases:
                others = self._meant(phrase)
                alike = _share(stems, set(map(stem, others)))
                best = max(best, 2 * alike + _share(pairs, _pairs(" ".join(others))))
            scores.append((-best, at, act.name))
        return tuple(name for _, _, name in sorted(scores)[:OFFERED])

    def _meant(self, phrase: str) -> list[str]:
        """The words of a phrase that count."""
        return [word for word in words_of(phrase) if word not in self.idle]


def _is_done_with(step: Step, before: Step) -> bool:
    """Whether a step is done together with the one before it: an act with what goes somewhere, and no turn."""
    if "stop" in (before.kind, step.kind):
        return False
    if step.kind == "act":
        return before.kind != "act" and not before.is_turn
    return before.kind != "act" or (step.kind == "go" and not step.is_turn)


def _way(kinds: Sequence[str], side: str, degrees: float) -> tuple[float, bool]:
    """Degrees to the left, and whether the facing stays, of kinds of words and a side."""
    back = "back" in kinds
    backwards = "backwards" in kinds
    sideways = "sideways" in kinds
    aside = backwards or sideways or ("step" in kinds and (bool(side) or back))
    if backwards or back or "around" in kinds:
        return 180.0, aside
    turns = (side or sideways) and "circle" not in kinds
    return (-degrees if side == "right" else degrees) if turns else 0.0, aside


GOING_KINDS = ("forward", "backwards", "back", "circle", "step", "sideways")
"""Kinds of words that let a figure go, beside gaits."""

APOSTROPHES = str.maketrans("", "", "'`\u2019")

MARKS = (",", ".", ";", "!", "?")


def words_of(text: str) -> list[str]:
    """The words, numbers and stops of a text, in lower case, apostrophes left out."""
    plain = text.lower().translate(APOSTROPHES).replace("after that", "then")
    return re.findall(r"[^\W\d_]+|\d+|[,.;!?]", plain)


def _split(words: Iterable[str], at: Iterable[str]) -> list[list[str]]:
    """The parts of words between some of them."""
    stops = frozenset(at)
    parts: list[list[str]] = [[]]
    for word in words:
        if word in stops:
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def _pairs(text: str) -> set[str]:
    """The pairs of letters that follow each other."""
    return {text[at : at + 2] for at in range(len(text) - 1)}


def _share(first: set[str], second: set[str]) -> float:
    """How much two sets have in common, from 0 to 1."""
    return 2 * len(first & second) / (len(first) + len(second)) if first and second else 0.0


@cache
def words_for(gaits: tuple[str, ...]) -> Words:
    """The words of the repertoire for a figure of some gaits."""
    return Words(document()["words"], entries(), gaits)

"""Programs as C99, for games and firmware: the same operations in the same order as in machine code, and so the same bits.

What is printed needs no library. Where the target has no fused multiply-add or square root of its own, they are computed: the
one after Boldo and Melquiond (2008), by a sum rounded to odd; the other by Newton's method and a last step with the exact
remainder (Markstein 1990).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from articulated.compiler.branches import Branch, branched
from articulated.compiler.graph import MASKS
from articulated.compiler.ir import Format
from articulated.compiler.program import Program, Tape
from articulated.compiler.schedule import Chunk, Exit, Item, Read, Repeat, Schedule, Write, schedule

_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "and": "&"}
_CALLS = {
    "sqrt": "art_sqrt",
    "abs": "art_abs",
    "power2": "art_power2",
    "exponent": "art_exponent",
    "fraction": "art_fraction",
}


def identifier(name: str) -> str:
    """A name that C accepts."""
    word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lower()
    return word if word and not word[0].isdigit() else f"rig_{word}"


def prelude(single: bool) -> str:
    """The arithmetic that every function uses."""
    pattern = Format(1, single).pattern
    real, bits = ("float", "uint32_t") if single else ("double", "uint64_t")
    text = _PRELUDE + (_SINGLE if single else _DOUBLE) + _PATTERNS
    shown = {"REAL": real, "BITS": bits, "SHIFT": str(pattern.shift)}
    shown |= {"ONE": hex(pattern.one), "ROOT": hex(pattern.root)}
    for name, value in shown.items():
        text = text.replace(f"@{name}@", value)
    return text


def declaration(program: Program, prefix: str, single: bool) -> str:
    """The prototype of a program's function, without the semicolon."""
    real = "float" if single else "double"
    given = [array for array in program.arguments if array.name not in program.constants]
    parts = [f"const {real} {array.name}[{max(1, array.size)}]" for array in given]
    parts += [f"{real} {array.name}[{max(1, array.size)}]" for array in program.results]
    return f"void {prefix}_{program.name}({', '.join(parts)})"


def definition(program: Program, prefix: str, single: bool) -> str:
    """The function of a program, and those that it is made of."""
    tape = Tape(program, single)
    plan = schedule(tape.graph, tape.outputs, None, 1)
    printer = _Printer(plan, program, f"{prefix}_{program.name}", single)
    calls = printer.statements(plan.items)
    head = [declaration(program, prefix, single), "{", f"    {printer.real} s[{max(1, plan.size)}];"]
    for constant, values in program.constants.items():
        head.append(f"    static const {printer.real} {constant}[] = {{{', '.join(map(printer.constant, values))}}};")
    unused = [f"    (void){array.name};" for array in program.arguments if array.name not in "\n".join(calls)]
    return "\n".join([*printer.parts, *head, *unused, "    (void)s;", *calls, "}", ""])


class _Printer:
    """Of one program.

    Attributes:
        parts: the functions that it has been divided into so far.
    """

    def __init__(self, plan: Schedule, program: Program, name: str, single: bool):
        self.plan, self.program, self.name, self.single = plan, program, name, single
        self.real = "float" if single else "double"
        self.parts: list[str] = []

    def statements(self, items: Sequence[Item]) -> list[str]:
        """What the items do, one statement a line."""
        lines: list[str] = []
        for item in items:
            if isinstance(item, Chunk):
                if item.nodes or item.copies:
                    part = f"{self.name}_{len(self.parts)}"
                    body = self.chunk(item) + self.copies(item)
                    self.parts.append(f"static void {part}({self.real} *s)\n{{\n{body}}}\n")
                    lines.append(f"{part}(s);")
            elif isinstance(item, Read):
                array = self.program.arguments[item.array].name
                lines += [f"s[{self.plan.slot(i)}] = {array}[{k}];" for k, i in item.scalars]
            elif isinstance(item, Write):
                array = self.program.results[item.array].name
                lines += [f"{array}[{k}] = {self.value(i, set())};" for k, i in item.scalars]
            elif isinstance(item, Repeat) and item.loop.yields:
                raise ValueError(f"{self.program.name} has loops over rows; such cannot be printed as C")
            elif isinstance(item, Repeat) and isinstance(item.loop.count, int) and not item.loop.records:
                k = f"k{item.loop.region}"
                lines.append(f"{{ int {k}; for ({k} = 0; {k} < {item.loop.count}; ++{k}) {{")
                lines += self.statements(item.items)
                lines.append("} }")
            elif isinstance(item, Exit):
                lines.append(f"if ({self.value(item.mask, set())}) break;")
            else:
                raise ValueError(f"{self.program.name} has loops whose turns only a call knows; such cannot be printed as C")
        return [f"    {line}" for line in lines]

    def copies(self, chunk: Chunk) -> str:
        """What a chunk does last: values to other slots, all at once."""
        sources = [self.value(source, set()) for source, _ in chunk.copies]
        targets = [f"s[{self.plan.slot(target)}]" for _, target in chunk.copies]
        stays = "" if chunk.unless is None else f"{self.value(chunk.unless, set())} ? @ : "
        lines = [
            f"    const {self.real} c{k} = {stays.replace('@', t)}{x};\n"
            for k, (x, t) in enumerate(zip(sources, targets, strict=True))
        ]
        return "".join([*lines, *(f"    {target} = c{k};\n" for k, target in enumerate(targets))])

    def chunk(self, chunk: Chunk) -> str:
        """The statements of a chunk."""
        lines: list[str] = []
        here: set[int] = set()
        for part in branched(self.plan.nodes, self.plan.guards, chunk.nodes):
            lines += self._computed(part, here)
            for i in [part] if isinstance(part, int) else part.yields:
                lines += self._kept(i, chunk, here)
        return "".join(f"    {line}\n" for line in lines)

    def _computed(self, part: int | Branch, here: set[int]) -> list[str]:
        """The statements of a node, or of a branch; what is known then is `here`."""
        if isinstance(part, int):
            lines = [self._defined(part, here), *self._stored(part)]
            here.add(part)
            return lines
        lines = []
        for i in part.yields:
            lines.append(f"{self.real} x{i} = {self.value(self.plan.nodes[i][-1], here)};")
            here.add(i)
        lines.append(f"if ({self.value(part.mask, here)}) {{")
        inside = set(here)
        for some in part.parts:
            if isinstance(some, int) and some in part.yields:
                lines.append(f"    x{some} = {self.value(self.plan.nodes[some][-2], inside)};")
            else:
                lines += (f"    {line}" for line in self._computed(some, inside))
        return [*lines, "}", *(line for i in part.yields for line in self._stored(i))]

    def _defined(self, i: int, here: set[int]) -> str:
        node = self.plan.nodes[i]
        return f"const {'int' if node[0] in MASKS else self.real} x{i} = {self._operation(node, here)};"

    def _stored(self, i: int) -> list[str]:
        """A node into its slot, if it has one."""
        x = f"({self.real})x{i}" if self.plan.nodes[i][0] in MASKS else f"x{i}"
        return [f"s[{self.plan.slots[i]}] = {x};"] if i in self.plan.slots else []

    def _kept(self, i: int, chunk: Chunk, here: set[int]) -> list[str]:
        """A node in the place of a carried one, if it is to go there."""
        if i not in chunk.kept:
            return []
        carried, unless = chunk.kept[i]
        place = f"s[{self.plan.slot(carried)}]"
        stays = "" if unless is None else f"{self.value(unless, here)} ? {place} : "
        return [f"{place} = {stays}x{i};"]

    def value(self, i: int, here: set[int]) -> str:
        """A node's value, where these nodes are at hand."""
        node = self.plan.nodes[i]
        if node[0] == "const":
            return self.constant(node[1])
        if i in here:
            return f"x{i}"
        slot = f"s[{self.plan.slot(i)}]"
        return f"({slot} != 0)" if node[0] in MASKS else slot

    def _operation(self, node: Sequence, here: set[int]) -> str:
        op, *parts = node
        if op == "bit":
            return f"(int)(art_bits({self.value(parts[1], here)}) >> {parts[0]} & 1)"
        x = [self.value(a, here) for a in parts]
        if op in _INFIX:
            return f"{x[0]} {_INFIX[op]} {x[1]}"
        if op in _CALLS:
            return f"{_CALLS[op]}({x[0]})"
        if op == "same":
            return x[0]
        if op == "neg":
            return f"-{x[0]}"
        if op == "select":
            return f"{x[0]} ? {x[1]} : {x[2]}"
        sign_a, sign_c = {"fma": ("", ""), "fms": ("", "-"), "fnma": ("-", "")}[op]
        return f"art_fma({sign_a}{x[0]}, {x[1]}, {sign_c}{x[2]})"

    def constant(self, x: float) -> str:
        """A number, to the last bit."""
        x = Format(1, self.single).rounded(x)
        if math.isfinite(x):
            text = x.hex() + ("f" if self.single else "")
            return f"({text})" if x < 0.0 else text
        infinity = f"art_from_bits({hex(0x7F800000 if self.single else 0x7FF0000000000000)}u)"
        return f"({infinity} - {infinity})" if math.isnan(x) else f"(-{infinity})" if x < 0.0 else infinity


_PRELUDE = """
#include <stdint.h>
#include <string.h>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

static inline @BITS@ art_bits(@REAL@ x)
{
    @BITS@ b;
    memcpy(&b, &x, sizeof b);
    return b;
}

static inline @REAL@ art_from_bits(@BITS@ b)
{
    @REAL@ x;
    memcpy(&x, &b, sizeof x);
    return x;
}

/* the last bit of s made 1 if something was lost: e is what s lacks */
static inline double art_odd(double s, double e)
{
    uint64_t b;
    memcpy(&b, &s, sizeof b);
    if (e != 0.0 && (b & 1u) == 0u)
        b += (e > 0.0) == (s > 0.0) ? 1u : (uint64_t)-1;
    memcpy(&s, &b, sizeof s);
    return s;
}

/* what a + b lacks, s being their rounded sum */
static inline double art_lost(double a, double b, double s)
{
    const double t = s - a;
    return (a - (s - t)) + (b - t);
}
"""

_DOUBLE = """
#if defined(__GNUC__) && (defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(__aarch64__))
#define art_fma(a, b, c) __builtin_fma(a, b, c)
#else
static inline double art_high(double x)
{
    const double t = 134217729.0 * x;
    return t - (t - x);
}

/* a b + c rounded once, unless a b leaves the normal numbers */
static inline double art_fma(double a, double b, double c)
{
    const double p = a * b, ah = art_high(a), bh = art_high(b), al = a - ah, bl = b - bh;
    const double low = ((ah * bh - p) + ah * bl + al * bh) + al * bl;
    const double t = c + low, u = p + t, lost = art_lost(p, t, u), rest = art_lost(c, low, t), z = rest + lost;
    if (p == 0.0 || p - p != 0.0 || c - c != 0.0 || low - low != 0.0)
        return p + c;
    return u + art_odd(z, art_lost(rest, lost, z));
}
#endif

static inline double art_sqrt(double x)
{
#if defined(__SSE2__)
    return _mm_cvtsd_f64(_mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(x)));
#else
    double y, scale = 1.0;
    int k;
    if (!(x > 0.0) || x - x != 0.0)
        return x == 0.0 || x > 0.0 ? x : x - x == 0.0 ? (x - x) / (x - x) : x;
    if (x < 0x1p-900) {
        x *= 0x1p+200;
        scale = 0x1p-100;
    }
    y = art_from_bits((art_bits(x) >> 1) + 0x1ff7a3bea91d9b1bu);
    for (k = 0; k < 5; ++k)
        y = 0.5 * (y + x / y);
    return scale * art_fma(art_fma(-y, y, x), 0.5 / y, y);
#endif
}
"""

_SINGLE = """
#if defined(__GNUC__) && (defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(__aarch64__))
#define art_fma(a, b, c) __builtin_fmaf(a, b, c)
#else
/* the product is exact as a double; the sum is rounded to odd, and so once more without harm */
static inline float art_fma(float a, float b, float c)
{
    const double p = (double)a * b, s = p + c;
    return (float)(s - s != 0.0 ? s : art_odd(s, art_lost(p, c, s)));
}
#endif

static inline float art_sqrt(float x)
{
#if defined(__SSE2__)
    return _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(x)));
#else
    double y, scale = 1.0;
    int k;
    if (!(x > 0.0f) || x - x != 0.0f)
        return x == 0.0f || x > 0.0f ? x : x - x == 0.0f ? (x - x) / (x - x) : x;
    if (x < 0x1p-100f) {
        x *= 0x1p+48f;
        scale = 0x1p-24;
    }
    y = art_from_bits((art_bits(x) >> 1) + 0x1fbb4f2eu);
    for (k = 0; k < 4; ++k)
        y = 0.5 * (y + x / y);
    return (float)(scale * y); /* a root of 24 bits is never so near the middle of two others that 53 could mislead */
#endif
}
"""

_PATTERNS = """
static inline @REAL@ art_abs(@REAL@ x) { return art_from_bits(art_bits(x) << 1 >> 1); }
static inline @REAL@ art_power2(@REAL@ x) { return art_from_bits((art_bits(x) << @SHIFT@) + @ONE@u); }
/* x = fraction 2^exponent, the fraction from half the root of 2 to that root */
static inline int art_whole(@REAL@ x)
{
    const @BITS@ b = art_bits(x) - @ROOT@u;
    return (int)(b >> @SHIFT@) - ((b >> (8 * sizeof b - 1)) ? 1 << (8 * sizeof b - @SHIFT@) : 0);
}
static inline @REAL@ art_exponent(@REAL@ x) { return (@REAL@)art_whole(x); }
static inline @REAL@ art_fraction(@REAL@ x) { return art_from_bits(art_bits(x) - ((@BITS@)art_whole(x) << @SHIFT@)); }
"""

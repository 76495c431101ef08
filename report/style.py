"""The style sheet: colours for light and dark, one column on a phone, ink on paper.

``:host`` rules apply where the web page embeds the report in a shadow tree, in which there is no ``:root`` and no body.

Zero has the colour of the background, large values the strongest contrast: yellow-green-blue for sizes, blue-orange for
signed values (after the palettes of Brewer, 2003, which colour-blind readers can distinguish). Before and after are
vermilion and blue of Okabe and Ito (2008), and differ in shape as well.
"""

from __future__ import annotations

from collections.abc import Sequence

from wingfit.report.svg import LEVELS, SIDES

_LEVELS_LIGHT = ("#f1f4e6", "#c7e9b4", "#7fcdbb", "#41b6c4", "#1d91c0", "#225ea8", "#0c2c84")
_LEVELS_DARK = ("#22302f", "#1f4a7a", "#1d79ab", "#33a9bd", "#7fcdbb", "#cdebb0", "#fffbd0")
_SIDES_LIGHT = ("#08519c", "#6baed6", "#f2f2ef", "#fdae6b", "#a63603")
_SIDES_DARK = ("#a9d3f7", "#3f86c4", "#262f2e", "#c4713a", "#ffc996")

# Series of line charts, distinguishable in grey and by colour-blind readers (Okabe and Ito, 2008).
_SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")

_LIGHT = """--ground:#fbfbf9;--surface:#fff;--line:#dfe1de;--ink:#1d2422;--quiet:#55605d;--faint:#8d9794;
--trough:#e9ebe7;--before:#d55e00;--after:#0072b2;--floor:#1d2422;--strong:#1f7a80;--pale:#8fb9b8;--warn:#a8341f;--soft:#faeae6;
--veil:rgba(255,255,255,.72);--hatch:#9aa5a2;--wing:#f4f5f1"""
_DARK = """--ground:#121716;--surface:#1a2120;--line:#2e3836;--ink:#e6ebe9;--quiet:#a3b0ac;--faint:#72807b;
--trough:#2b3533;--before:#f5924e;--after:#63b8ee;--floor:#e6ebe9;--strong:#5cc2c7;--pale:#3d7476;--warn:#f08b74;--soft:#3a211c;
--veil:rgba(26,33,32,.72);--hatch:#72807b;--wing:#202928"""

_RULES = """
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body,:host{color:var(--ink);font-variant-numeric:tabular-nums;overflow-wrap:anywhere}
body{margin:0;background:var(--ground);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Noto Sans",sans-serif}
main{max-width:72rem;margin:0 auto;padding:1.2rem 1rem 4rem}
h1{font-size:1.75rem;line-height:1.2;margin:.3rem 0 .6rem;letter-spacing:-.01em;text-wrap:balance}
h2{font-size:1.15rem;margin:2.6rem 0 .8rem;padding-top:.8rem;border-top:2px solid var(--line)}
h3{font-size:1rem;margin:1rem 0 .25rem}
p{margin:.3rem 0;max-width:48rem}
.over{color:var(--quiet);font-size:.9rem;margin:0}
.quiet,.note{color:var(--quiet);font-size:.86rem}
.warning{border-left:4px solid var(--warn);background:var(--soft);padding:.5rem .8rem}
.badge{display:inline-block;font-size:.75rem;font-weight:500;border:1px solid var(--line);border-radius:99px;
padding:0 .5rem;margin-left:.5rem;color:var(--quiet);vertical-align:.1em}
.badge.measurement{border-color:var(--before);color:var(--before)}
.badge.physics{border-color:var(--after);color:var(--after)}
figure{margin:1.2rem 0 1.8rem;break-inside:avoid}
figcaption{font-weight:650;font-size:1.02rem;line-height:1.35;margin-bottom:.5rem;max-width:48rem}
.panels{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,21rem),1fr));gap:.8rem;align-items:start}
.panels.small{grid-template-columns:repeat(auto-fill,minmax(min(100%,17rem),1fr))}
.panels.wide{grid-template-columns:repeat(auto-fill,minmax(min(100%,28rem),1fr))}
.panels.wide figure>svg{max-width:40rem}
.panels figure{margin:.4rem 0;min-width:0}
.panels>svg,.panels figure>svg{display:block;width:100%;max-width:32rem;height:auto;
background:var(--surface);border:1px solid var(--line);border-radius:8px}
svg text{fill:var(--ink);font-size:12px}
svg .title{font-weight:650;font-size:12.5px}
svg .value{paint-order:stroke;stroke:var(--surface);stroke-width:4px;stroke-linejoin:round}
svg .label{fill:var(--quiet);font-size:11.5px}
svg .tick{fill:var(--quiet);font-size:11px}
.grid{stroke:var(--line);stroke-width:1}
.axis{stroke:var(--faint);stroke-width:1.2}
.mark{stroke:var(--ink);stroke-width:2}
.leader{stroke:var(--faint);stroke-width:1}
.outline{fill:var(--wing);stroke:var(--faint);stroke-width:1.2;stroke-linejoin:round}
.place{fill:none;stroke:var(--before);stroke-width:1.6;stroke-dasharray:5 3}
.marker{stroke:var(--quiet);stroke-width:.7}
.ring{fill:none;stroke:var(--ink);stroke-width:1.6}
.point{fill:var(--faint)}
.arrow{fill:none;stroke:var(--before);stroke-width:1.5;stroke-linecap:round}
.frame{fill:none;stroke:var(--ink);stroke-width:1.2;stroke-linecap:round}
.curve{fill:none;stroke-width:2;stroke-linejoin:round}
.curve.before{stroke:var(--before);stroke-dasharray:5 3}
.curve.after{stroke:var(--after)}
.points{fill:none;stroke:var(--faint);stroke-width:2.5;stroke-linecap:round}
.samples{fill:none;stroke:var(--ink);opacity:.5;stroke-width:4.5;stroke-linecap:round}
.noise{stroke:var(--ink);stroke-width:1.3;stroke-dasharray:2 3}
.band{fill:var(--after);opacity:.22}
.whisker{fill:none;stroke-width:1.6}
.whisker.before,.dot.before{stroke:var(--before)}
.whisker.after,.dot.after{stroke:var(--after)}
.dot{stroke-width:1.8}
.dot.before{fill:var(--surface)}
.dot.after{fill:var(--after)}
.floor{stroke:var(--floor);stroke-width:2.2}
.trough{fill:var(--trough)}
.strong{fill:var(--strong)}
.plain{fill:var(--after)}
.pale{fill:var(--pale)}
.guess{fill:url(#guess)}
.guess-line{stroke:var(--after);stroke-width:3}
.faint{fill:url(#hatch)}
.veil{fill:var(--veil)}
.hatch{stroke:var(--hatch);stroke-width:1}
.bar{display:block;width:100%;height:.7rem}
.legend{list-style:none;display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;margin:.5rem 0 0;padding:0;font-size:.86rem}
.legend svg{width:1.5rem;height:1rem;vertical-align:-.15rem;margin-right:.4rem}
.bars{display:grid;grid-template-columns:7.6rem minmax(3rem,1fr) 4.4rem;gap:.3rem .7rem;
align-items:center;font-size:.86rem;align-content:start}
.bars .name{color:var(--quiet)}
.bars .value{text-align:right}
.bars .negative{color:var(--warn)}
.verdicts{grid-template-columns:8.6rem minmax(3rem,1fr) 4.4rem;max-width:34rem;margin:1rem 0}
.verdicts .chosen{font-weight:700;color:var(--ink)}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(9.5rem,1fr));gap:.7rem;margin:1.2rem 0;padding:0}
.tiles div{background:var(--surface);border:1px solid var(--line);border-radius:8px;padding:.6rem .8rem}
.tiles dt{font-size:.82rem;color:var(--quiet)}
.tiles dd{margin:0;font-size:1.3rem;font-weight:650;line-height:1.3}
.tiles small{display:block;font-size:.8rem;font-weight:400;color:var(--quiet)}
.ranking{list-style:none;margin:0;padding:0}
.ranking li{display:grid;grid-template-columns:minmax(0,1fr) minmax(0,1fr);gap:.6rem 1.6rem;padding:.9rem 0;
border-top:1px solid var(--line);break-inside:avoid}
.ranking li.named{border-left:4px solid var(--strong);padding-left:.8rem}
.ranking h3{margin:0 0 .15rem}
.ranking p{font-size:.88rem;margin:.15rem 0}
.scroll{overflow-x:auto;margin:.6rem 0}
table{border-collapse:collapse;font-size:.88rem;width:100%}
th{font-weight:600;color:var(--quiet);text-align:left;vertical-align:bottom}
th,td{padding:.3rem .7rem .3rem 0;border-bottom:1px solid var(--line);vertical-align:top;overflow-wrap:break-word}
td:last-child:not(.number){min-width:10rem}
th.number,td.number{text-align:right;white-space:nowrap}
details{margin:.6rem 0}
summary{cursor:pointer;color:var(--quiet);font-size:.9rem}
ul.plain{margin:.3rem 0;padding-left:1.2rem}
footer{margin-top:3rem;border-top:2px solid var(--line);padding-top:.8rem}
.defs{position:absolute;width:0;height:0}
:host{display:block;margin-top:1.5rem}
:host h1{font-size:1.35rem}
@media(max-width:40rem){.ranking li{grid-template-columns:minmax(0,1fr)}h1{font-size:1.45rem}}
@media print{body{font-size:10.5pt}main{max-width:none;padding:0}h2{break-after:avoid}.scroll{overflow:visible}
.panels{grid-template-columns:repeat(2,1fr)}:root{--ground:#fff}details::details-content{content-visibility:visible;display:block}
svg,.warning{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
"""


def style_sheet() -> str:
    """All rules; no part of them loads anything."""
    light = f":root,:host{{color-scheme:light dark;{_LIGHT}}}{_palette(_LEVELS_LIGHT, _SIDES_LIGHT)}"
    dark = (
        f"@media screen and (prefers-color-scheme:dark){{:root,:host{{{_DARK}}}{_palette(_LEVELS_DARK, _SIDES_DARK)}}}"
    )
    series = "".join(f".curve.s{k}{{stroke:{colour}}}" for k, colour in enumerate(_SERIES))
    return light + _RULES + series + dark


def _palette(levels: Sequence[str], sides: Sequence[str]) -> str:
    named = [(f"l{k}", _mixed(levels, k / (LEVELS - 1))) for k in range(LEVELS)]
    named += [(f"d{k}", _mixed(sides, k / (2 * SIDES))) for k in range(2 * SIDES + 1)]
    return "".join(f".{name}{{fill:{colour}}}" for name, colour in named)


def _mixed(anchors: Sequence[str], part: float) -> str:
    """The colour at ``part`` of the way along ``anchors``."""
    place = part * (len(anchors) - 1)
    k = min(int(place), len(anchors) - 2)
    ends = [[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in anchors[k : k + 2]]
    mixed = [round(a + (place - k) * (b - a)) for a, b in zip(*ends, strict=True)]
    return "#" + "".join(f"{v:02x}" for v in mixed)

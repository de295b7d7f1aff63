"""The report's style sheet: phone first, wide screens, dark and light, A4."""

from __future__ import annotations

from dataclasses import fields

from backdrive.report.pictures.canvas import DARK, LIGHT, Theme
from backdrive.report.words import esc

POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"


def page(title: str, body: str) -> str:
    """Return a whole page that names no address and runs no script.

    Args:
        title: of the page, any text.
        body: HTML.
    """
    return (
        "<!DOCTYPE html>\n"
        '<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark"><meta name="referrer" content="no-referrer">'
        f"<title>{esc(title)}</title>\n<style>{CSS}</style></head>\n<body><main>\n{body}\n</main></body></html>\n"
    )


def _colours(theme: Theme) -> str:
    return "".join(f"--{f.name.replace('_', '-')}:{getattr(theme, f.name)};" for f in fields(theme))


_LIGHT = _colours(LIGHT) + "--panel:#f5f7f9;--good:#1a5f94;--care:#8a4b00;--poor:#b3261e;--accent:#1a5f94"
_DARK = _colours(DARK) + "--panel:#1c2229;--good:#7cc0f5;--care:#f5b267;--poor:#ff8d80;--accent:#7cc0f5"

CSS = (
    f":root{{color-scheme:light dark;{_LIGHT}}}\n"
    f"@media screen and (prefers-color-scheme:dark){{:root{{{_DARK}}}}}\n"
    """
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%;text-size-adjust:100%}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,
"Helvetica Neue",Arial,sans-serif;overflow-wrap:anywhere;font-variant-numeric:tabular-nums}
main{max-width:1120px;margin:0 auto;padding:20px 16px 48px}
h1{font-size:1.6rem;line-height:1.2;margin:0 0 .5rem;text-wrap:balance}
h2{font-size:1.25rem;line-height:1.3;margin:0}
h3{font-size:.95rem;margin:1.4rem 0 .4rem}
p{margin:.4rem 0}
a{color:inherit;text-underline-offset:2px;text-decoration-color:var(--muted)}
a:focus-visible,summary:focus-visible{outline:2px solid var(--accent);outline-offset:2px}
.lead{font-size:1.1rem;line-height:1.45;max-width:68ch;text-wrap:pretty}
.muted,small{color:var(--muted)}
small{font-size:.86em}
.n{white-space:nowrap}
.facts{display:flex;flex-wrap:wrap;gap:.2rem 1.6rem;margin:.8rem 0 0;font-size:.92rem}
.facts div{display:flex;gap:.45rem}
.facts dt{color:var(--muted)}
.facts dd{margin:0}
.chip{display:inline-block;font-size:.84rem;font-weight:600;line-height:1.35;padding:.1rem .55rem;
border:1.5px solid currentColor;border-radius:99px;white-space:nowrap;color:var(--muted)}
.chip.good{color:var(--good)}.chip.care{color:var(--care)}.chip.poor{color:var(--poor)}
.flag{color:var(--care);font-weight:600;font-size:.86em;white-space:nowrap}
.warn{border-left:4px solid var(--care);background:var(--panel);padding:.6rem .9rem;margin:.9rem 0;max-width:80ch}
.warn b{color:var(--care)}
.warn ul{margin:.25rem 0 0;padding-left:1.1rem}
table{border-collapse:collapse;width:100%;font-size:.92rem}
caption,.caption{text-align:left;font-weight:600;font-size:.95rem;padding:0 0 .3rem}
th,td{text-align:left;vertical-align:baseline;padding:.34rem .75rem .34rem 0;border-bottom:1px solid var(--grid)}
th:last-child,td:last-child{padding-right:0}
thead th{font-weight:500;color:var(--muted);font-size:.86rem;vertical-align:bottom}
tbody th{font-weight:500}
thead th{overflow-wrap:normal}
.about tbody th{min-width:5.5em}
.summary .name{min-width:6.5rem}
.summary td{padding-right:1rem}
.joint{border-top:2px solid var(--ink);padding-top:.9rem;margin-top:2.6rem;scroll-margin-top:8px}
.head{display:flex;flex-wrap:wrap;gap:.3rem .8rem;align-items:center}
.tables>*+*{margin-top:1.5rem}
figure{margin:0;min-width:0}
.legend,figcaption{max-width:80ch;font-size:.86rem;color:var(--muted);margin-top:.15rem;line-height:1.45}
svg{display:block;width:100%;height:auto;stroke-linejoin:round;max-width:510px}
.wide{overflow-x:auto}
.wide svg{max-width:900px;min-width:620px}
svg text{font-family:inherit}
.grid{display:grid;gap:1.4rem;margin-top:1rem}
.grid>*{min-width:0}
.key{display:inline-block;margin-right:.9rem;white-space:nowrap;color:var(--ink)}
.key svg{display:inline-block;width:20px;height:10px;margin-right:.3rem;vertical-align:baseline}
pre{background:var(--panel);border:1px solid var(--grid);border-radius:6px;padding:.7rem .85rem;margin:.4rem 0;
font:.86rem/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;white-space:pre-wrap;overflow-wrap:anywhere}
pre.copy{user-select:all;-webkit-user-select:all}
pre.file{max-height:26rem;overflow-y:auto}
code{font-family:ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;font-size:.92em}
details{margin-top:.5rem}
summary{cursor:pointer;color:var(--accent);font-size:.95rem;padding:.25rem 0}
.about{border-top:2px solid var(--ink);margin-top:2.6rem;padding-top:.9rem}
.about dl{margin:.4rem 0}
.about dt{font-weight:600;font-size:.92rem;margin-top:.5rem}
.about dd{margin:0;font-size:.92rem}
.summary{margin-top:1.4rem}
@media screen and (max-width:899px){
.summary thead{display:none}
.summary,.summary tbody{display:block}
.summary tr{display:grid;grid-template-columns:repeat(20,minmax(0,1fr));row-gap:.4rem;padding:.8rem 0;
border-bottom:1px solid var(--grid)}
.summary tr:first-child{border-top:1px solid var(--grid)}
.summary th,.summary td{display:block;border:0;padding:0;min-width:0!important;grid-column:span 10}
.summary td:has(.long){grid-column:1/-1}
.summary .name{grid-column:1/-1;font-size:1rem;font-weight:600}
.summary .verdict{grid-column:1/-1;justify-self:start}
.summary [data-label]::before{content:attr(data-label);display:block;color:var(--muted);font-size:.82rem}
.summary .none{display:none}
.summary .count::before{content:attr(data-label) ": "!important;display:inline!important}
}
@media (min-width:720px){
.residuals{grid-template-columns:repeat(3,minmax(0,1fr));gap:1rem}
}
@media (min-width:900px){
main{padding:36px 28px 64px}
h1{font-size:2rem}
h2{font-size:1.4rem}
.pair{grid-template-columns:minmax(0,1.08fr) minmax(0,1fr);gap:2.4rem}
}
@media print{
@page{size:A4;margin:14mm 13mm}
html{font-size:10.6px}
body{font-size:1rem;line-height:1.4}
main{max-width:none;padding:0}
h1{font-size:2rem}h2{font-size:1.5rem}
th,td{padding-top:.22rem;padding-bottom:.22rem}
.tables>*+*{margin-top:1.1rem}
pre.file,.screen{display:none}
.joint{break-before:page;border-top:0;margin-top:0;padding-top:0}
:not(.joint)+.joint{break-before:auto;margin-top:1.8rem}
.about{break-inside:avoid-page}
.grid{gap:12px;margin-top:8px}
.pair{grid-template-columns:minmax(0,.88fr) minmax(0,1fr);gap:24px}
.residuals{grid-template-columns:repeat(3,minmax(0,1fr));gap:14px}
figure,tr,.warn,pre{break-inside:avoid}
h2,h3,caption{break-after:avoid}
details::details-content{content-visibility:visible;height:auto;display:block}
summary{list-style:none}
summary::-webkit-details-marker{display:none}
.chip,.warn,.key svg,svg{print-color-adjust:exact;-webkit-print-color-adjust:exact}
}
"""
)

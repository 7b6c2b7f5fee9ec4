"""Log-log plots as SVG. The same figures give the same bytes."""

import math

WIDTH, HEIGHT = 720, 460
LEFT, RIGHT, TOP, BOTTOM = 70, 130, 40, 55
COLOURS = ["#222222", "#0072b2", "#009e73", "#d55e00", "#cc79a7"]


def loglog(path, title, axes, series):
    """Plots `series` (name -> [(x, y)]) and, dashed, n log n through the first point of the first."""
    points = [p for line in series.values() for p in line]
    x_range, y_range = decades(p[0] for p in points), decades(p[1] for p in points)

    def place(x, y):
        across = (math.log10(x) - x_range[0]) / (x_range[1] - x_range[0])
        up = (math.log10(y) - y_range[0]) / (y_range[1] - y_range[0])
        return (LEFT + across * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM))

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}"'
        ' font-family="sans-serif" font-size="13" fill="#222">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        text(LEFT, TOP - 16, title, size=16),
    ]
    for exponent in range(math.ceil(x_range[0]), math.floor(x_range[1]) + 1):
        x, low = place(10**exponent, 10 ** y_range[0])
        out.append(line([(x, low), (x, TOP)], "#ddd"))
        out.append(text(x, low + 18, number(10**exponent), anchor="middle"))
    for exponent in range(math.ceil(y_range[0]), math.floor(y_range[1]) + 1):
        left, y = place(10 ** x_range[0], 10**exponent)
        out.append(line([(left, y), (WIDTH - RIGHT, y)], "#ddd"))
        out.append(text(left - 8, y + 4, number(10**exponent), anchor="end"))
    middle = LEFT + (WIDTH - LEFT - RIGHT) / 2
    out.append(text(middle, HEIGHT - 12, axes[0], anchor="middle"))
    out.append(f'<g transform="translate(16 {HEIGHT / 2}) rotate(-90)">{text(0, 0, axes[1], anchor="middle")}</g>')
    first = next(iter(series.values()))
    unit = first[0][1] / (first[0][0] * math.log(first[0][0]))
    ideal = [place(x, unit * x * math.log(x)) for x, _ in first]
    # Clipped at the top of the frame.
    ideal = [p for p in ideal if p[1] >= TOP]
    out.append(line(ideal, "#888", dash=True))
    out.append(text(ideal[-1][0] + 6, ideal[-1][1] + 4, "n log n", colour="#888"))
    ends = []
    for colour, (name, values) in zip(COLOURS, series.items()):
        placed = [place(x, max(y, 10 ** y_range[0])) for x, y in values]
        out.append(line(placed, colour, width=2))
        out += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in placed]
        ends.append([placed[-1][1], name, colour])
    # Labels stay at least one line apart.
    ends.sort()
    for k, end in enumerate(ends):
        if k > 0:
            end[0] = max(end[0], ends[k - 1][0] + 15)
        out.append(text(WIDTH - RIGHT + 10, end[0] + 4, end[1], colour=end[2]))
    out.append("</svg>\n")
    path.write_text("\n".join(out))


def decades(values):
    logs = [math.log10(max(v, 0.1)) for v in values]
    return math.floor(min(logs) * 2) / 2, math.ceil(max(logs) * 2) / 2


def number(value):
    return f"{value:,.0f}".replace(",", " ") if value >= 1 else f"{value:g}"


def text(x, y, words, anchor="start", size=13, colour="#222"):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" fill="{colour}">{words}</text>'


def line(points, colour, width=1, dash=False):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dashes = ' stroke-dasharray="5 4"' if dash else ""
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"{dashes}/>'

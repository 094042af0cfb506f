"""Layout of a certificate's PDF in typst; every text comes as data, none as markup."""

TEMPLATE = r"""
#let data = json(bytes(sys.inputs.certificate))
#let ink = rgb("#22303c")
#let faint = rgb("#5b6873")
#let accent = rgb("#1f5a99")
#let line-colour = rgb("#d5dbe0")
#let shades = (good: ("#eaf4f0", "#1e8e74"), doubtful: ("#fbf3e2", "#b87a00"), failed: ("#fbecec", "#c8323c"))
#let signs = (good: "✓", doubtful: "?", failed: "✗")
#let words(s) = text(s)
#let picture-of(image-data, ..arguments) = image(
  bytes(image-data.bytes), format: image-data.format, ..arguments,
)

#set document(
  title: data.title, author: data.author, keywords: data.keywords,
  date: datetime(year: data.date.at(0), month: data.date.at(1), day: data.date.at(2)),
)
#set page(
  paper: "a4", margin: (x: 18mm, top: 20mm, bottom: 21mm),
  header: context if counter(page).get().first() > 1 {
    set text(size: 7.5pt, fill: faint)
    grid(columns: (1fr, 1fr), align: (left, right), gutter: 8mm, words(data.heading), words(data.subject))
    v(-2mm)
    line(length: 100%, stroke: 0.4pt + line-colour)
  },
  footer: context {
    set text(size: 7.5pt, fill: faint)
    grid(
      columns: (1fr, auto), gutter: 8mm, words(data.foot),
      [page #counter(page).display() of #counter(page).final().first()],
    )
  },
)
#set text(font: ("Libertinus Serif", "New Computer Modern Math", "DejaVu Sans Mono"), size: 9.5pt, fill: ink,
  lang: "en", hyphenate: false)
#set par(justify: false, leading: 0.55em)
#show heading.where(level: 1): it => {
  set text(size: 19pt, fill: ink)
  block(above: 5mm, below: 2mm, it.body)
}
#show heading.where(level: 2): it => {
  set text(size: 12pt, fill: accent)
  block(above: 6mm, below: 2.4mm, sticky: true, it.body)
}

#let facts(rows, pairs: 1) = {
  set text(size: 8.8pt)
  grid(
    columns: (auto, 1fr) * pairs, column-gutter: 3mm, row-gutter: 1.9mm,
    ..rows.map(row => (
      text(fill: faint, row.at(0)),
      if row.at(1) == data.missing { text(fill: faint, style: "italic", row.at(1)) } else { words(row.at(1)) },
    )).flatten()
  )
}

// Width of the cells, in characters: a word in a wide column may break, a number may not.
#let table-size(rows, kinds, heads) = {
  let total = 0
  for (column, kind) in kinds.enumerate() {
    let longest = 0
    for row in rows { longest = calc.max(longest, row.at(column).clusters().len()) }
    let most = (w: 34, h: 50, t: 22, n: longest)
    // A head is bold, and its words may break at spaces.
    let head = calc.max(..heads.at(column).split(" ").map(word => 1.1 * word.clusters().len()))
    total += calc.max(head, calc.min(longest, most.at(kind)))
  }
  let room = 174mm - kinds.len() * 3.4mm
  calc.max(4.6pt, calc.min(8.6pt, room / calc.max(total, 1) / 0.47))
}

#let written(cell, kind, size) = if kind == "n" { text(cell.replace(regex("^-"), "−")) } else if kind == "h" {
  text(font: "DejaVu Sans Mono", size: 0.8 * size, cell)
} else { words(cell) }
#let caption(s) = block(above: 4mm, below: 2mm, sticky: true, text(size: 9pt, weight: "bold", words(s)))
#let grid-table(it) = {
  if it.caption != "" { caption(it.caption) }
  let size = table-size(it.rows, it.kinds, it.columns)
  set text(size: size)
  show table.cell.where(y: 0): set text(weight: "bold")
  table(
    columns: it.kinds.map(kind => if kind == "w" { 1fr } else { auto }),
    align: it.kinds.map(kind => if kind == "n" { right } else { left }),
    inset: (x: 1.6mm, y: 1.15mm),
    stroke: (x, y) => (bottom: (if y == 0 { 0.7pt + accent } else { 0.4pt + line-colour })),
    fill: (x, y) => if y == 0 { rgb("#f3f6f8") },
    table.header(..it.columns.map(words)),
    ..it.rows.map(row => row.zip(it.kinds).map(((cell, kind)) => written(cell, kind, size))).flatten()
  )
}

#let show-block(it) = {
  if it.kind == "facts" { facts(it.rows) }
  else if it.kind == "paragraph" {
    block(below: 2.2mm, if it.faint { text(size: 8pt, fill: faint, words(it.text)) } else { words(it.text) })
  }
  else if it.kind == "grid" { grid-table(it) }
  else if it.kind == "drawing" {
    block(breakable: false, width: 100%)[
      #picture-of(it.image, width: 100%)
      #text(size: 8pt, fill: faint, words(it.caption))
    ]
  }
  else {
    caption(it.caption)
    set text(font: "DejaVu Sans Mono", size: 7.5pt)
    set par(leading: 0.5em)
    for line in it.lines { block(below: 1mm, above: 1mm, words(line)) }
  }
}
#let chapter(it) = {
  heading(level: 2, text(it.title))
  for each in it.blocks { show-block(each) }
}

// Letterhead
#grid(
  columns: if data.logo == none { (1fr, auto) } else { (auto, 1fr, auto) }, column-gutter: 6mm, align: horizon,
  ..if data.logo != none { (box(height: 17mm, picture-of(data.logo, height: 17mm, fit: "contain")),) },
  {
    text(size: 12pt, weight: "bold", words(data.laboratory.name))
    for line in data.laboratory.lines { linebreak(); text(size: 8.5pt, fill: faint, words(line)) }
  },
  box(width: 46mm, align(right, text(size: 8.5pt, fill: faint)[accreditation \ #words(data.laboratory.accreditation)])),
)
#v(-1mm)
#line(length: 100%, stroke: 1.4pt + accent)

= #words(data.heading)
#text(size: 10.5pt, fill: faint, words(data.subject))

#block(
  width: 100%, inset: (x: 3mm, y: 2.2mm), radius: 1mm, fill: rgb(shades.at(data.verdict.word).at(0)),
  stroke: (left: 2.5pt + rgb(shades.at(data.verdict.word).at(1))),
)[
  #text(font: "DejaVu Sans Mono", size: 9pt, signs.at(data.verdict.word))
  #text(weight: "bold", upper(data.verdict.word.first()) + data.verdict.word.slice(1)): #words(data.verdict.why).
]
#facts(data.facts, pairs: 2)

// The signatures stand at the foot of the page on which the results begin.
#place(bottom, float: true, clearance: 7mm, block(breakable: false, width: 100%, {
  set text(size: 8.5pt)
  grid(
    columns: (1fr,) * calc.min(3, data.signatures.len()), column-gutter: 8mm, row-gutter: 13mm,
    ..data.signatures.map(each => block(width: 100%, inset: (top: 1.4mm), stroke: (top: 0.6pt + ink), {
      if each.at(1) != "" { text(weight: "bold", words(each.at(1))); linebreak() }
      text(fill: faint)[#words(each.at(0)), date, signature]
    }))
  )
}))
#chapter(data.results)
#pagebreak(weak: true)
#for each in data.chapters { chapter(each) }
"""

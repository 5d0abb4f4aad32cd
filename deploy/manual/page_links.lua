-- SPDX-License-Identifier: Apache-2.0
-- For pandoc: a link to a Markdown file of this project leads to the page made from it.
function Link(link)
  if not link.target:match("^%a+:") then
    link.target = link.target:gsub("%.md$", ".html"):gsub("%.md#", ".html#")
  end
  return link
end

# The documents keep to the project. SPDX-License-Identifier: Apache-2.0
#   cmake -DSOURCE=... -P documents.cmake
cmake_minimum_required(VERSION 3.22)

# README.md gives the very line that .ci/run runs.
file(STRINGS ${SOURCE}/.ci/run lines)
list(POP_BACK lines line)
file(READ ${SOURCE}/README.md readme)
string(FIND "${readme}" "${line}" found)
if(found EQUAL -1 OR NOT line MATCHES "ctest")
  message(SEND_ERROR "README.md does not give the last line of .ci/run: ${line}")
endif()

# Its example is docs/examples/first.cpp, but for the comment on top, with what that prints.
file(READ ${SOURCE}/docs/examples/first.cpp program)
string(FIND "${program}" "#include" begin)
string(SUBSTRING "${program}" ${begin} -1 program)
file(READ ${SOURCE}/docs/examples/first.expected printed)
foreach(part program printed)
  string(FIND "${readme}" "${${part}}" found)
  if(found EQUAL -1)
    message(SEND_ERROR "README.md does not hold this of docs/examples/first:\n${${part}}")
  endif()
endforeach()

# Links from page to page lead somewhere.
file(GLOB pages ${SOURCE}/*.md ${SOURCE}/docs/*.md)
foreach(page ${pages})
  file(READ ${page} text)
  get_filename_component(folder ${page} DIRECTORY)
  string(REPLACE "](" "<" text "${text}")
  string(REGEX REPLACE "[][;]" "" text "${text}")  # which would keep a list from being one
  string(REGEX MATCHALL "<[^):# \n]+\\.md" links "${text}")
  foreach(link ${links})
    string(SUBSTRING ${link} 1 -1 link)
    if(NOT EXISTS ${folder}/${link})
      message(SEND_ERROR "${page} links to ${link}, which does not exist")
    endif()
  endforeach()
endforeach()

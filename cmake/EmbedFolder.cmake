# SPDX-License-Identifier: Apache-2.0
# cmake -DFOLDER=... -DOUTPUT=... -P EmbedFolder.cmake: writes the files of a folder, compressed, as a C++ source.
set(names)
if(FOLDER)
  file(GLOB_RECURSE names RELATIVE ${FOLDER} ${FOLDER}/*)
  list(FILTER names EXCLUDE REGEX "\\.(map|gz)$")
  list(SORT names)
  if(NOT names)
    message(FATAL_ERROR "the folder ${FOLDER} is empty: the dashboard was not built; -DRIGCAL_DASHBOARD=OFF builds a "
      "server without it")
  endif()
endif()
set(arrays)
set(entries)
set(number 0)
foreach(name ${names})
  set(compressed ${OUTPUT}.gz)
  execute_process(COMMAND gzip -9 -n -c ${FOLDER}/${name} OUTPUT_FILE ${compressed} COMMAND_ERROR_IS_FATAL ANY)
  file(READ ${compressed} bytes HEX)
  file(REMOVE ${compressed})
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
  string(REGEX REPLACE "((0x..,)(0x..,)(0x..,)(0x..,)(0x..,)(0x..,)(0x..,)(0x..,))" "\\1\n" bytes "${bytes}")
  string(APPEND arrays "constexpr unsigned char kFile${number}[] = {\n${bytes}};\n")
  string(APPEND entries "    {\"${name}\", Bytes(kFile${number}, sizeof kFile${number})},\n")
  math(EXPR number "${number} + 1")
endforeach()
set(head "// Made by cmake/EmbedFolder.cmake.
#include <cstddef>
#include <string_view>

#include \"server/http/asset_routes.h\"

namespace rigcal::server {
")
if(number EQUAL 0)
  set(body "
absl::Span<const WebAsset> BuiltInAssets() { return {}; }
")
else()
  set(body "namespace {

${arrays}
std::string_view Bytes(const unsigned char* bytes, size_t size) {
  return {reinterpret_cast<const char*>(bytes), size};
}

}  // namespace

absl::Span<const WebAsset> BuiltInAssets() {
  static const WebAsset kAssets[] = {
${entries}  };
  return kAssets;
}
")
endif()
file(WRITE ${OUTPUT} "${head}${body}
}  // namespace rigcal::server
")

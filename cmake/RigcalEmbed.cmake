# SPDX-License-Identifier: Apache-2.0
# rigcal_embed_folder(<name> <folder> <target>): library rigcal_<name> with the function BuiltInAssets of
# server/http/asset_routes.h, which gives the files of a folder, each compressed with gzip -9. An empty folder name:
# there are none. <target> (may be empty) makes the folder at build time, and names the files that it depends on in its
# property RIGCAL_OUTPUTS; the folder is listed after it has run.
set(RIGCAL_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/EmbedFolder.cmake)

function(rigcal_embed_folder name folder target)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc)
  set(depends)
  if(target)
    get_target_property(depends ${target} RIGCAL_OUTPUTS)
    if(NOT depends)
      set(depends)
    endif()
    list(APPEND depends ${target})
  elseif(folder)
    file(GLOB_RECURSE depends CONFIGURE_DEPENDS ${folder}/*)
  endif()
  add_custom_command(
    OUTPUT ${source}
    COMMAND ${CMAKE_COMMAND} -DFOLDER=${folder} -DOUTPUT=${source} -P ${RIGCAL_EMBED_SCRIPT}
    DEPENDS ${depends} ${RIGCAL_EMBED_SCRIPT}
    COMMENT "Embedding the dashboard"
    VERBATIM)
  add_library(rigcal_${name} STATIC ${source})
  target_include_directories(rigcal_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(rigcal_${name} PRIVATE absl::span absl::status absl::strings rigcal_build_flags)
endfunction()

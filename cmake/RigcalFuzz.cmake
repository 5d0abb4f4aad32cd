# SPDX-License-Identifier: Apache-2.0
# How fuzz targets are declared (docs/fuzzing.md). Each is one file with LLVMFuzzerTestOneInput. In every build it is
# linked with a main that replays its corpus, and CTest runs that; with clang and RIGCAL_FUZZ=ON it is a libFuzzer
# program. The code under test is compiled once more for it, always with the address and undefined-behaviour sanitizers.

option(RIGCAL_FUZZ "Build the fuzz targets as libFuzzer programs; needs clang" OFF)

set(rigcal_fuzz_sanitizers address,undefined)
set(rigcal_fuzz_driver "")
if(RIGCAL_FUZZ)
  if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    message(FATAL_ERROR "RIGCAL_FUZZ needs clang with its run-time library (Debian: clang libclang-rt-dev); "
      "configure with --preset fuzz")
  endif()
  set(rigcal_fuzz_driver fuzzer,)
endif()

add_library(rigcal_fuzz_flags INTERFACE)
target_compile_options(rigcal_fuzz_flags INTERFACE -O1 -g1 -UNDEBUG -fno-omit-frame-pointer
  -fsanitize=${rigcal_fuzz_sanitizers} -fno-sanitize-recover=all)
if(RIGCAL_FUZZ)
  target_compile_options(rigcal_fuzz_flags INTERFACE -fsanitize=fuzzer-no-link -Wno-unknown-warning-option)
endif()
# Sanitizers make gcc 12 see uninitialised values and too small regions; the normal build warns about the same files.
target_compile_options(rigcal_fuzz_flags INTERFACE -Wno-error
  $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>)
add_custom_target(fuzz_targets)

# rigcal_sanitized_library(<name> [EXCEPT files...]): rigcal_<name>_sanitized, the library rigcal_<name> and what it
# depends on compiled once more with the sanitizers; without those of its files that no fuzz target needs.
function(rigcal_sanitized_library name)
  cmake_parse_arguments(ARG "" "" "EXCEPT" ${ARGN})
  get_target_property(sources rigcal_${name} SOURCES)
  get_target_property(folder rigcal_${name} SOURCE_DIR)
  get_target_property(dependencies rigcal_${name} LINK_LIBRARIES)
  if(ARG_EXCEPT)
    list(REMOVE_ITEM sources ${ARG_EXCEPT})
  endif()
  add_library(rigcal_${name}_sanitized STATIC)
  target_include_directories(rigcal_${name}_sanitized PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(rigcal_${name}_sanitized PRIVATE rigcal_build_flags rigcal_fuzz_flags)
  foreach(source ${sources})
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
    get_source_file_property(options ${source} TARGET_DIRECTORY rigcal_${name} COMPILE_OPTIONS)
    if(options)
      set_source_files_properties(${source} PROPERTIES COMPILE_OPTIONS "${options}")
    endif()
    target_sources(rigcal_${name}_sanitized PRIVATE ${source})
  endforeach()
  list(REMOVE_ITEM dependencies rigcal_build_flags)
  foreach(dependency ${dependencies})
    if(dependency MATCHES "^rigcal::(.*)$")
      set(own ${CMAKE_MATCH_1})
      get_target_property(kind rigcal_${own} TYPE)
      if(NOT kind STREQUAL INTERFACE_LIBRARY)
        if(NOT TARGET rigcal_${own}_sanitized)
          rigcal_sanitized_library(${own})
        endif()
        set(dependency rigcal_${own}_sanitized)
      endif()
    endif()
    target_link_libraries(rigcal_${name}_sanitized PUBLIC ${dependency})
  endforeach()
endfunction()

# rigcal_fuzz_target(<name> [SOURCES ...] DEPS ... [LIBS ...]): tests/fuzz/<name>.cc, built as tests/fuzz.<name>; in
# CTest fuzz/<name>, which replays tests/fuzz/corpus/<name>. SOURCES, from the top folder, are code under test that is in
# none of DEPS, the names of sanitized libraries; LIBS are linked as they are.
function(rigcal_fuzz_target name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;LIBS" ${ARGN})
  set(target fuzz.${name})
  list(TRANSFORM ARG_SOURCES PREPEND ${PROJECT_SOURCE_DIR}/)
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/fuzz/${name}.cc ${ARG_SOURCES})
  if(NOT RIGCAL_FUZZ)
    target_sources(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/fuzz/replay_main.cc)
  endif()
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  list(TRANSFORM ARG_DEPS PREPEND rigcal_)
  list(TRANSFORM ARG_DEPS APPEND _sanitized)
  target_link_libraries(${target} PRIVATE ${ARG_DEPS} ${ARG_LIBS} rigcal_build_flags rigcal_fuzz_flags)
  target_link_options(${target} PRIVATE -fsanitize=${rigcal_fuzz_driver}${rigcal_fuzz_sanitizers})
  add_dependencies(fuzz_targets ${target})
  set(replay)
  if(RIGCAL_FUZZ)
    set(replay -runs=0)
  endif()
  add_test(NAME fuzz/${name} COMMAND ${target} ${replay} ${PROJECT_SOURCE_DIR}/tests/fuzz/corpus/${name})
  set_tests_properties(fuzz/${name} PROPERTIES TIMEOUT 120 LABELS fuzz)
endfunction()

# SPDX-License-Identifier: Apache-2.0
# Fuzz targets (docs/contribute/fuzzing.md). Each is one file with LLVMFuzzerTestOneInput. In every build it is linked with a main
# that replays its corpus, and CTest runs that; the asan preset does so under the sanitizers. With clang and
# RIGCAL_FUZZ=ON it is a libFuzzer program.

add_custom_target(fuzz_targets)

# rigcal_fuzz_target(<name> DEPS ...): tests/fuzz/<name>.cc, built as tests/fuzz.<name>; in CTest fuzz/<name>, which
# replays tests/fuzz/corpus/<name>.
function(rigcal_fuzz_target name)
  cmake_parse_arguments(ARG "" "" "DEPS" ${ARGN})
  set(target fuzz.${name})
  add_executable(${target} ${PROJECT_SOURCE_DIR}/tests/fuzz/${name}.cc)
  set(replay)
  if(RIGCAL_FUZZ)
    target_link_options(${target} PRIVATE -fsanitize=fuzzer)
    set(replay -runs=0)
  else()
    target_sources(${target} PRIVATE ${PROJECT_SOURCE_DIR}/tests/fuzz/replay_main.cc)
  endif()
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  target_link_libraries(${target} PRIVATE ${ARG_DEPS} rigcal_build_flags)
  add_dependencies(fuzz_targets ${target})
  add_test(NAME fuzz/${name} COMMAND ${target} ${replay} ${PROJECT_SOURCE_DIR}/tests/fuzz/corpus/${name})
  set_tests_properties(fuzz/${name} PROPERTIES TIMEOUT 120 LABELS fuzz)
endfunction()

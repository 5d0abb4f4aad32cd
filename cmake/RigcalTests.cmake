# SPDX-License-Identifier: Apache-2.0
# Functions that declare test folders. The tests of a folder are one program. In CTest each file is a separate test,
# <folder>/<file>, so that `ctest -R server/solve` selects that folder and a crash ends only one file's tests.

# Tests that only call what they test compile without optimisation, in half the time. Then their own precompiled header
# pays as well; with optimisation it costs more than it saves.
set(rigcal_unoptimised)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND NOT RIGCAL_SANITIZE)
  set(rigcal_unoptimised -O0)
endif()
rigcal_precompile(rigcal_precompiled_for_tests
  HEADERS ${rigcal_common_headers} <gmock/gmock.h> <gtest/gtest.h>
  DEPS absl::statusor absl::strings GTest::gmock
  OPTIONS ${rigcal_unoptimised})

# Seconds after which a test is taken to hang. Sanitizers make solves ten times as slow.
function(rigcal_time_limit result seconds)
  if(RIGCAL_SANITIZE)
    math(EXPR seconds "10 * ${seconds}")
  endif()
  set(${result} ${seconds} PARENT_SCOPE)
endfunction()

# The googletest filter for one file's tests: the suites it defines, read from its TEST macros.
function(rigcal_suites_of file result)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(STRINGS ${file} lines REGEX "^(TEST|TEST_F|TEST_P|TYPED_TEST|RC_GTEST_PROP|RC_GTEST_FIXTURE_PROP)\\(")
  set(suites)
  foreach(line ${lines})
    if(line MATCHES "^[A-Z_]+\\( *([A-Za-z0-9_]+)")
      list(APPEND suites ${CMAKE_MATCH_1})
    endif()
  endforeach()
  list(REMOVE_DUPLICATES suites)
  if(NOT suites)
    message(FATAL_ERROR "${file} has no TEST")
  endif()
  set(${result} ${suites} PARENT_SCOPE)
endfunction()

# rigcal_tests(<folder> [COMPUTES] TESTS <file without .cc>... [SOURCES ...] DEPS ... [PROGRAMS ...]): the program
# tests/<folder> with dots for slashes. COMPUTES: these tests do much work of their own, and are worth optimising.
# PROGRAMS are targets that must be built before the tests run.
function(rigcal_tests folder)
  cmake_parse_arguments(ARG "COMPUTES" "" "TESTS;SOURCES;DEPS;PROGRAMS" ${ARGN})
  string(REPLACE "/" "." target test.${folder})
  list(TRANSFORM ARG_TESTS APPEND .cc OUTPUT_VARIABLE files)
  add_executable(${target} ${files} ${ARG_SOURCES})
  set_target_properties(${target} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  target_compile_definitions(${target} PRIVATE
    RIGCAL_SOURCE_DIR="${PROJECT_SOURCE_DIR}" RIGCAL_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}")
  target_link_libraries(${target} PRIVATE ${ARG_DEPS} rigcal::testing GTest::gmock GTest::gtest_main
    rigcal_build_flags)
  if(ARG_COMPUTES)
    rigcal_compile_together(${target} rigcal_precompiled)
    rigcal_optimise(${target} COLD)
  else()
    rigcal_compile_together(${target} rigcal_precompiled_for_tests)
    target_compile_options(${target} PRIVATE ${rigcal_unoptimised})
  endif()
  if(ARG_PROGRAMS)
    add_dependencies(${target} ${ARG_PROGRAMS})
  endif()
  set(seen)
  foreach(test ${ARG_TESTS})
    rigcal_suites_of(${CMAKE_CURRENT_SOURCE_DIR}/${test}.cc suites)
    set(filters)
    foreach(suite ${suites})
      if(suite IN_LIST seen)
        message(FATAL_ERROR "tests/${folder}: two files define the suite ${suite}; rename the one in ${test}.cc")
      endif()
      list(APPEND seen ${suite})
      list(APPEND filters ${suite}.* */${suite}.* ${suite}/*)
    endforeach()
    list(JOIN filters : filter)
    add_test(NAME ${folder}/${test} COMMAND ${target} --gtest_filter=${filter})
    rigcal_time_limit(limit 120)
    set_tests_properties(${folder}/${test} PROPERTIES TIMEOUT ${limit} ENVIRONMENT "OMP_THREAD_LIMIT=1"
      SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
    if("${folder}/${test}" IN_LIST RIGCAL_SLOW_TESTS)
      set_tests_properties(${folder}/${test} PROPERTIES LABELS slow)
    endif()
  endforeach()
endfunction()

# rigcal_test_properties(<folder> <file>... PROPERTIES ...): set_tests_properties for files of one folder.
function(rigcal_test_properties folder)
  list(FIND ARGN PROPERTIES split)
  list(SUBLIST ARGN 0 ${split} tests)
  list(SUBLIST ARGN ${split} -1 properties)
  list(TRANSFORM tests PREPEND ${folder}/)
  list(FIND properties TIMEOUT at)
  if(NOT at EQUAL -1)
    math(EXPR at "${at} + 1")
    list(GET properties ${at} seconds)
    rigcal_time_limit(limit ${seconds})
    list(REMOVE_AT properties ${at})
    list(INSERT properties ${at} ${limit})
  endif()
  set_tests_properties(${tests} ${properties})
endfunction()

# rigcal_python_test(<folder> <test> SECONDS <limit>): <test>.py beside the calling list, on the programs of this build.
find_package(Python3 COMPONENTS Interpreter)
function(rigcal_python_test folder test)
  cmake_parse_arguments(ARG "" "SECONDS" "" ${ARGN})
  if(NOT Python3_Interpreter_FOUND)
    return()
  endif()
  add_test(NAME ${folder}/${test}
    COMMAND ${CMAKE_COMMAND} -E env PYTHONDONTWRITEBYTECODE=1 RIGCAL_BUILD_DIR=${PROJECT_BINARY_DIR}
      ${Python3_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/${test}.py -v)
  rigcal_time_limit(limit ${ARG_SECONDS})
  set_tests_properties(${folder}/${test} PROPERTIES TIMEOUT ${limit})
endfunction()

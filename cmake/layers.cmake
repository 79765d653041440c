# The floors of the house (docs/ARCHITECTURE.md). A room may use only rooms on strictly lower floors;
# room() makes a wrong edge a configure error and tests/layers checks the includes against this table.
set(LIGHTSTAGE_FLOORS
  base=0
  optics=1 proto=1
  dataset=2
  drivers/api=3
  drivers/conformance=4 sim/render=4 relight=4
  drivers/link=5 sim/scenes=5 relight/cli=5
  drivers/aravis=6 drivers/canopen=6 drivers/display=6 drivers/dlpc350=6 drivers/dmx=6 drivers/modbus=6
  drivers/v4l2=6 sim/rig=6
  sim/peers=7 sim/peers/canopen=7 sim/peers/display=7 sim/peers/dlpc350=7 sim/peers/dmx=7 sim/peers/modbus=7
  sim/peers/uvc=7
  daemon/config=7
  daemon/rig=8
  daemon/calibrate=9
  daemon/capture=9
  daemon/engine=10
  daemon/develop=11
  daemon/store=12
  daemon/runs=13
  daemon/rpc=14
  daemon/app=15
  bench=16
  tools/render=16
  # Clients know the contract only, as anyone's client would.
  client/cpp=2
  client/cli=3
)

function(floor_of ROOM OUT)
  foreach(entry IN LISTS LIGHTSTAGE_FLOORS)
    if(entry MATCHES "^(.+)=([0-9]+)$" AND CMAKE_MATCH_1 STREQUAL ROOM)
      set(${OUT} ${CMAKE_MATCH_2} PARENT_SCOPE)
      return()
    endif()
  endforeach()
  message(FATAL_ERROR "room '${ROOM}' has no floor in cmake/layers.cmake")
endfunction()

function(target_of ROOM OUT)
  string(REPLACE "/" "_" name "${ROOM}")
  set(${OUT} "room_${name}" PARENT_SCOPE)
endfunction()

# room(<folder> SOURCES ... ROOMS <lower rooms> [LIBS <imported targets>] [PRIVATE_LIBS ...]
#      [TESTS <*_test.cc>] [TEST_ROOMS <rooms>] [TEST_LIBS <targets>])
#
# One folder, one static library, and one test executable from its *_test.cc. ROOMS must lie on lower floors.
# TEST_ROOMS are what only the tests use, under the same rule.
function(room ROOM)
  cmake_parse_arguments(R "" "" "SOURCES;ROOMS;LIBS;PRIVATE_LIBS;TESTS;TEST_ROOMS;TEST_LIBS" ${ARGN})
  if(R_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "room(${ROOM}): unknown arguments ${R_UNPARSED_ARGUMENTS}")
  endif()
  floor_of(${ROOM} own)
  target_of(${ROOM} target)
  set(edges "")
  set(test_edges "")
  foreach(lower IN LISTS R_ROOMS R_TEST_ROOMS)
    floor_of(${lower} theirs)
    if(NOT theirs LESS own)
      message(FATAL_ERROR "room '${ROOM}' (floor ${own}) may not use '${lower}' (floor ${theirs})")
    endif()
  endforeach()
  foreach(lower IN LISTS R_ROOMS)
    target_of(${lower} edge)
    list(APPEND edges ${edge})
  endforeach()
  foreach(lower IN LISTS R_TEST_ROOMS)
    target_of(${lower} edge)
    list(APPEND test_edges ${edge})
  endforeach()
  if(R_SOURCES)
    add_library(${target} STATIC ${R_SOURCES})
    target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} PUBLIC ${edges} ${R_LIBS} PRIVATE ${R_PRIVATE_LIBS} lightstage_warnings)
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE ${PROJECT_SOURCE_DIR})
    target_link_libraries(${target} INTERFACE ${edges} ${R_LIBS})
  endif()
  if(R_TESTS AND LIGHTSTAGE_TESTS)
    add_executable(test_${target} ${R_TESTS})
    target_link_libraries(test_${target} PRIVATE ${target} ${test_edges} ${R_TEST_LIBS} ${R_PRIVATE_LIBS}
                          lightstage_warnings GTest::gmock GTest::gtest_main)
    target_compile_definitions(test_${target} PRIVATE LIGHTSTAGE_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
    gtest_discover_tests(test_${target} TEST_PREFIX "${ROOM}: " PROPERTIES LABELS unit TIMEOUT 300
                         DISCOVERY_TIMEOUT 120)
    set_property(GLOBAL APPEND PROPERTY LIGHTSTAGE_UNIT_TESTS test_${target})
  endif()
endfunction()

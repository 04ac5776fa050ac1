/* What an exported S-function uses of Simulink's simstruc.h, for tests without Simulink. */
#ifndef SIMSTRUC_H
#define SIMSTRUC_H

#include <stddef.h>

typedef double real_T;
typedef int int_T;
typedef struct {
  real_T value;
} mxArray;

enum { STUB_WIDTH = 16 };

typedef struct {
  mxArray parameter;
  int_T parameters, inputs, outputs, input_width, output_width[2], sample_times, works, work_width[4];
  real_T sample_time, offset;
  real_T input[STUB_WIDTH], output[2][STUB_WIDTH], work[4][STUB_WIDTH];
  const char *error;
} SimStruct;

#define ssSetNumSFcnParams(S, n) ((S)->parameters = (n))
#define ssGetNumSFcnParams(S) ((S)->parameters)
#define ssGetSFcnParamsCount(S) 1
#define ssSetNumInputPorts(S, n) (((S)->inputs = (n)), 1)
#define ssSetNumOutputPorts(S, n) (((S)->outputs = (n)), 1)
#define ssSetInputPortWidth(S, port, n) ((S)->input_width = (n))
#define ssSetInputPortRequiredContiguous(S, port, n) ((void)(S))
#define ssSetInputPortDirectFeedThrough(S, port, n) ((void)(S))
#define ssSetOutputPortWidth(S, port, n) ((S)->output_width[port] = (n))
#define ssSetNumSampleTimes(S, n) ((S)->sample_times = (n))
#define ssSetNumDWork(S, n) ((S)->works = (n))
#define ssSetDWorkWidth(S, work, n) ((S)->work_width[work] = (n))
#define ssSetSampleTime(S, n, seconds) ((S)->sample_time = (seconds))
#define ssGetSampleTime(S, n) ((S)->sample_time)
#define ssSetOffsetTime(S, n, seconds) ((S)->offset = (seconds))
#define ssGetSFcnParam(S, n) (&(S)->parameter)
#define mxGetScalar(array) ((array)->value)
#define ssGetInputPortSignal(S, port) ((const void *)(S)->input)
#define ssGetOutputPortRealSignal(S, port) ((S)->output[port])
#define ssGetDWork(S, which) ((void *)(S)->work[which])
#define ssSetErrorStatus(S, text) ((S)->error = (text))

#endif

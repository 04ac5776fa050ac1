#include <string.h>

#include "module.h"

int grouser_copy_doubles(PyObject *object, const char *name, Py_ssize_t count, double *out) {
  grouser_array array;
  if (grouser_array_acquire(object, name, count, 0, &array) < 0) return -1;
  const int fits = array.rows == 1;
  if (fits)
    memcpy(out, array.data, sizeof(double) * (size_t)count);
  else
    PyErr_Format(PyExc_ValueError, "%s must hold %zd values", name, count);
  grouser_array_release(&array);
  return fits ? 0 : -1;
}

static int read_widths(PyObject *widths, grouser_dense *net) {
  const Py_ssize_t count = PySequence_Size(widths);
  if (count < 0) return -1;
  if (count < 2 || count > GROUSER_MAX_LAYERS + 1) {
    PyErr_Format(PyExc_ValueError, "a network has 1 to %d layers, got %zd", GROUSER_MAX_LAYERS, count - 1);
    return -1;
  }
  net->layers = (int)count - 1;
  for (Py_ssize_t i = 0; i < count; i++) {
    PyObject *item = PySequence_GetItem(widths, i);
    if (!item) return -1;
    const long width = PyLong_AsLong(item);
    Py_DECREF(item);
    if (width == -1 && PyErr_Occurred()) return -1;
    if (width < 1 || width > GROUSER_MAX_WIDTH) {
      PyErr_Format(PyExc_ValueError, "layer widths must lie in [1, %d], got %ld", GROUSER_MAX_WIDTH, width);
      return -1;
    }
    net->widths[i] = (int)width;
  }
  return 0;
}

/* Copies the packed float32 parameters and points every layer into the copy. */
static float *pack_parameters(PyObject *bytes, grouser_dense *net) {
  size_t count = 0;
  for (int layer = 0; layer < net->layers; layer++)
    count += (size_t)(net->widths[layer] + 1) * (size_t)net->widths[layer + 1];
  char *data;
  Py_ssize_t length;
  if (PyBytes_AsStringAndSize(bytes, &data, &length) < 0) return NULL;
  if ((size_t)length != count * sizeof(float)) {
    PyErr_Format(PyExc_ValueError, "these layers need %zd bytes of float32 parameters, got %zd",
                 (Py_ssize_t)(count * sizeof(float)), length);
    return NULL;
  }
  float *parameters = PyMem_Malloc((size_t)length);
  if (!parameters) {
    PyErr_NoMemory();
    return NULL;
  }
  memcpy(parameters, data, (size_t)length);
  float *next = parameters;
  for (int layer = 0; layer < net->layers; layer++) {
    net->weights[layer] = next;
    next += (size_t)net->widths[layer] * (size_t)net->widths[layer + 1];
    net->biases[layer] = next;
    next += net->widths[layer + 1];
  }
  return parameters;
}

float *grouser_read_dense(int activation, PyObject *widths, PyObject *parameters, grouser_dense *net) {
  if (activation < GROUSER_RELU || activation > GROUSER_TANH) {
    PyErr_SetString(PyExc_ValueError, "activation must be 0 (relu), 1 (silu) or 2 (tanh)");
    return NULL;
  }
  net->activation = (enum grouser_activation)activation;
  return read_widths(widths, net) < 0 ? NULL : pack_parameters(parameters, net);
}

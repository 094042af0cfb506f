// WebGL 2 programs of a scene: ellipsoids, dots, beams, lines; everything instanced.
export interface Buffers {
  positions: Float32Array; // n x 3
  matrices: Float32Array; // n x 9
  colours: Uint8Array; // n x 4; alpha 0: hidden
  hollow: Uint8Array; // n: 1 a ring instead of a dot
  ellipsoids: boolean;
  dot: number; // px
  beams: Float32Array; // b x 6: both ends
  beamEnds: Float32Array; // b x 2: their points
  beamColours: Uint8Array; // b x 4
  beamWide: Uint8Array; // b, px times 10
  lines: Float32Array; // s x 6: segments
  lineColour: number[]; // 0 to 1
}
export interface Drawn { fill(data: Buffers): void; draw(matrix: Float32Array, eye: number[], size: [number, number], ratio: number, selected: number, beams: boolean, ground: number[]): void }

/** Vertices and triangles of an icosahedron, each face divided into four where asked. */
export function icosphere(divided: boolean): { vertices: number[]; faces: number[] } {
  const t = (1 + Math.sqrt(5)) / 2;
  const points: number[][] = [];
  for (const a of [-1, 1]) for (const b of [-t, t]) points.push([a, b, 0], [0, a, b], [b, 0, a]);
  // Faces are the triples of neighbours, 2 apart; in the order that shows its front outside.
  let faces: number[] = [];
  const near = (i: number, j: number) => Math.hypot(...points[i]!.map((v, k) => v - points[j]![k]!)) < 2.1;
  for (let i = 0; i < 12; i++) for (let j = i + 1; j < 12; j++) for (let k = j + 1; k < 12; k++) {
    if (!near(i, j) || !near(j, k) || !near(i, k)) continue;
    const [p, q, r] = [points[i]!, points[j]!, points[k]!] as [number[], number[], number[]];
    const outward = p[0]! * (q[1]! * r[2]! - q[2]! * r[1]!) + p[1]! * (q[2]! * r[0]! - q[0]! * r[2]!) + p[2]! * (q[0]! * r[1]! - q[1]! * r[0]!);
    faces.push(...(outward > 0 ? [i, j, k] : [i, k, j]));
  }
  if (divided) {
    const middle = new Map<number, number>();
    const between = (i: number, j: number) => {
      const key = Math.min(i, j) * 64 + Math.max(i, j);
      if (!middle.has(key)) middle.set(key, points.push(points[i]!.map((v, k) => v + points[j]![k]!)) - 1);
      return middle.get(key)!;
    };
    const finer: number[] = [];
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [faces[f]!, faces[f + 1]!, faces[f + 2]!];
      const [d, e, g] = [between(a, b), between(b, c), between(c, a)];
      finer.push(a, d, g, b, e, d, c, g, e, d, e, g);
    }
    faces = finer;
  }
  return { vertices: points.flatMap((p) => p.map((v) => v / Math.hypot(...p))), faces };
}

const HEAD = "#version 300 es\nprecision highp float;";
// Normals by the inverse transpose: the matrix has orthogonal columns, so that is each column over its square.
const SPHERE = `${HEAD}uniform mat4 m;uniform vec3 eye;in vec3 p,o,a,b,c;in vec4 k;out vec3 n,e;out vec4 v;
void main(){vec3 q=o+a*p.x+b*p.y+c*p.z;n=a*p.x/dot(a,a)+b*p.y/dot(b,b)+c*p.z/dot(c,c);e=eye-q;v=k;gl_Position=m*vec4(q,1);if(k.a==0.||dot(a,a)==0.)gl_Position=vec4(2,2,2,1);}`;
const SHADE = `${HEAD}in vec3 n,e;in vec4 v;out vec4 o;
void main(){float d=max(dot(normalize(n),normalize(e)),0.);o=vec4(v.rgb*(.35+.65*d),1);}`;
const DOT = `${HEAD}uniform mat4 m;uniform float s;in vec3 o;in vec4 k;in float h;out vec4 v;flat out float r;
void main(){v=k;r=h;gl_Position=m*vec4(o,1);gl_Position.z-=.0004*gl_Position.w;gl_PointSize=h>0.?s*2.4:s;if(k.a==0.)gl_Position=vec4(2,2,2,1);}`;
const DISC = `${HEAD}in vec4 v;flat in float r;out vec4 o;
void main(){float d=length(gl_PointCoord-.5)*2.;if(d>1.||(r>0.&&d<.62))discard;o=vec4(v.rgb,1);}`;
// A segment as a strip of two triangles, so that lines have a width.
const LINE = `${HEAD}uniform mat4 m;uniform vec2 z;uniform float s,l;in vec2 p;in vec3 a,b;in vec2 g;in vec4 k;in float t;out vec4 v;
void main(){vec4 x=m*vec4(a,1),y=m*vec4(b,1);x.w=max(x.w,1e-3);y.w=max(y.w,1e-3);vec2 d=(y.xy/y.w-x.xy/x.w)*z;d=d/max(length(d),1e-6);
bool h=l>=0.&&(g.x==l||g.y==l);v=k;if(h)v.a=1.;else if(l>=0.)v.a*=.35;
gl_Position=mix(x,y,p.x);gl_Position.xy+=vec2(-d.y,d.x)*p.y*(t*.1+(h?.6:0.))*s/z*gl_Position.w;if(k.a==0.)gl_Position=vec4(2,2,2,1);}`;
const FLAT = `${HEAD}in vec4 v;out vec4 o;void main(){o=v;}`;

/** Programs and buffers in a context; null where a program cannot be made. */
export function drawing(gl: WebGL2RenderingContext, divided: boolean): Drawn | null {
  const program = (vertex: string, fragment: string) => {
    const p = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(type);
      if (!shader) return null;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(p, shader);
    }
    gl.linkProgram(p);
    return gl.getProgramParameter(p, gl.LINK_STATUS) ? p : null;
  };
  const [spheres, dots, segments] = [program(SPHERE, SHADE), program(DOT, DISC), program(LINE, FLAT)];
  if (!spheres || !dots || !segments) return null;
  const mesh = icosphere(divided);
  const buffer = (data?: BufferSource, target: number = gl.ARRAY_BUFFER) => {
    const made = gl.createBuffer();
    gl.bindBuffer(target, made);
    if (data) gl.bufferData(target, data, gl.STATIC_DRAW);
    return made;
  };
  const [b, c, k, h] = [buffer(), buffer(), buffer(), buffer()];
  const [bp, be, bk, bw, lp] = [buffer(), buffer(), buffer(), buffer(), buffer()];
  type Attribute = [name: string, buffer: WebGLBuffer | null, size: number, stride: number, offset: number, divisor: number, type?: number];
  const array = (p: WebGLProgram, attributes: Attribute[]) => {
    const made = gl.createVertexArray();
    gl.bindVertexArray(made);
    for (const [name, from, size, stride, offset, divisor, type = gl.FLOAT] of attributes) {
      const at = gl.getAttribLocation(p, name);
      if (at < 0) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, from);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, type, type !== gl.FLOAT && size === 4, stride, offset);
      gl.vertexAttribDivisor(at, divisor);
    }
    return made;
  };
  const corner = buffer(new Float32Array([0, -1, 0, 1, 1, -1, 1, 1]));
  const sphereArray = array(spheres, [["p", buffer(new Float32Array(mesh.vertices)), 3, 0, 0, 0], ["o", b, 3, 12, 0, 1], ["a", c, 3, 36, 0, 1], ["b", c, 3, 36, 12, 1], ["c", c, 3, 36, 24, 1], ["k", k, 4, 4, 0, 1, gl.UNSIGNED_BYTE]]);
  buffer(new Uint16Array(mesh.faces), gl.ELEMENT_ARRAY_BUFFER);
  const dotArray = array(dots, [["o", b, 3, 12, 0, 0], ["k", k, 4, 4, 0, 0, gl.UNSIGNED_BYTE], ["h", h, 1, 1, 0, 0, gl.UNSIGNED_BYTE]]);
  const beamArray = array(segments, [["p", corner, 2, 0, 0, 0], ["a", bp, 3, 24, 0, 1], ["b", bp, 3, 24, 12, 1], ["g", be, 2, 8, 0, 1], ["k", bk, 4, 4, 0, 1, gl.UNSIGNED_BYTE], ["t", bw, 1, 1, 0, 1, gl.UNSIGNED_BYTE]]);
  const lineArray = array(segments, [["p", corner, 2, 0, 0, 0], ["a", lp, 3, 24, 0, 1], ["b", lp, 3, 24, 12, 1]]);
  let counts = { points: 0, beams: 0, lines: 0, ellipsoids: false, dot: 4 };
  let lineColour = [0, 0, 0];
  return {
    fill(data) {
      for (const [to, from] of [[b, data.positions], [c, data.matrices], [k, data.colours], [h, data.hollow], [bp, data.beams], [be, data.beamEnds], [bk, data.beamColours], [bw, data.beamWide], [lp, data.lines]] as const) {
        gl.bindBuffer(gl.ARRAY_BUFFER, to);
        gl.bufferData(gl.ARRAY_BUFFER, from, gl.STATIC_DRAW);
      }
      counts = { points: data.hollow.length, beams: data.beamWide.length, lines: data.lines.length / 6, ellipsoids: data.ellipsoids, dot: data.dot };
      lineColour = data.lineColour;
    },
    draw(matrix, eye, size, ratio, selected, beams, ground) {
      gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
      gl.clearColor(ground[0]!, ground[1]!, ground[2]!, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      const use = (p: WebGLProgram, vertices: WebGLVertexArrayObject | null) => {
        gl.useProgram(p);
        gl.uniformMatrix4fv(gl.getUniformLocation(p, "m"), false, matrix);
        gl.bindVertexArray(vertices);
      };
      if (counts.ellipsoids && counts.points) {
        gl.enable(gl.CULL_FACE);
        use(spheres, sphereArray);
        gl.uniform3fv(gl.getUniformLocation(spheres, "eye"), eye);
        gl.drawElementsInstanced(gl.TRIANGLES, mesh.faces.length, gl.UNSIGNED_SHORT, 0, counts.points);
        gl.disable(gl.CULL_FACE);
      }
      if (counts.points) {
        use(dots, dotArray);
        gl.uniform1f(gl.getUniformLocation(dots, "s"), counts.dot * ratio);
        gl.drawArrays(gl.POINTS, 0, counts.points);
      }
      gl.enable(gl.BLEND);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
      gl.depthMask(false);
      const strip = (vertices: WebGLVertexArrayObject | null, count: number, marked: number) => {
        if (!count) return;
        use(segments, vertices);
        gl.uniform2f(gl.getUniformLocation(segments, "z"), ...size);
        gl.uniform1f(gl.getUniformLocation(segments, "s"), ratio);
        gl.uniform1f(gl.getUniformLocation(segments, "l"), marked);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
      };
      const [kAt, tAt, gAt] = ["k", "t", "g"].map((name) => gl.getAttribLocation(segments, name)) as [number, number, number];
      gl.vertexAttrib4f(kAt, lineColour[0]!, lineColour[1]!, lineColour[2]!, 0.8);
      gl.vertexAttrib1f(tAt, 12);
      gl.vertexAttrib2f(gAt, -2, -2);
      strip(lineArray, counts.lines, -1);
      if (beams) strip(beamArray, counts.beams, selected);
      gl.depthMask(true);
      gl.disable(gl.BLEND);
    },
  };
}

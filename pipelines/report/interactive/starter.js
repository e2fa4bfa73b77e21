// Unpacks what the page carries and runs it; where a browser cannot, the images stay.
if (document.querySelector("figure.touchable") && typeof DecompressionStream !== "undefined") {
  const carried = atob(document.getElementById("carried").textContent);
  const bytes = Uint8Array.from(carried, (letter) => letter.charCodeAt(0));
  const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  new Response(plain).text().then((text) => {
    const script = document.createElement("script");
    script.textContent = text;
    document.body.append(script);
  });
}
